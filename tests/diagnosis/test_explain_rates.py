"""Noise, losses and outliers in turn: what one law brings with it needs no further name."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from diagnosis.data.patch import Patch
from diagnosis.fields import Mask
from diagnosis.prepare import Prepared
from tests.support.explained import explained
from tests.support.prepared_parts import ready


@pytest.fixture(scope="module")
def good() -> Prepared:
    return ready([], 5)


def losing(one: Prepared, lost: Callable[[Patch, np.random.Generator], Mask]) -> Prepared:
    rng = np.random.default_rng(4)
    patches: Sequence[Patch] = [
        replace(p, depth_mm=np.where(lost(p, rng), np.nan, p.depth_mm)) for p in one.patches
    ]
    return replace(one, patches=patches)


def test_outliers_beyond_the_range_are_not_lost_readings() -> None:
    """One outlier in four leaves the working range of 40 mm, and comes as no reading."""
    spikes = {"name": "outlier_spikes", "share": 0.03, "width_um": 17_000.0}
    found = explained(ready([spikes], 6))
    assert [c.name for c in found.causes] == ["outlier_spikes"]
    assert found.unexplained == ()


def test_light_that_falls_off_is_named_by_its_losses(good: Prepared) -> None:
    found = explained(losing(
        good, lambda p, rng: rng.random(p.shape) < 0.4 * (p.view.off_axis_mm / 20.0) ** 4
    ))  # fmt: skip
    assert [c.name for c in found.causes] == ["light_falloff"]


def test_a_shadow_in_the_middle_of_the_line_is_no_falloff(good: Prepared) -> None:
    """It follows the same covariate, and no light that falls towards the ends does that."""
    found = explained(losing(
        good, lambda p, rng: rng.random(p.shape) < 0.4 * np.exp(-((p.view.off_axis_mm / 5) ** 4))
    ))  # fmt: skip
    assert found.causes == ()
    assert {u.channel for u in found.unexplained} == {"missing"}
    assert found.unexplained[0].relaxed.along == ("x",)
    assert found.model.is_nominal


def test_losses_anywhere_are_none_of_a_gloss(good: Prepared) -> None:
    """Where few angles are seen a lobe may lose as many; its law has to say which."""
    found = explained(losing(good, lambda p, rng: rng.random(p.shape) < 0.02))
    assert [c.name for c in found.causes] == ["random_dropout"]
    assert found.unexplained == ()
