"""Outliers of one size are told from outliers by chance."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.claims.outliers_of_one_size import one_size_mm
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from tests.support.effect_case import bench_workspace

SHARE = 0.01


def with_outliers(draw) -> Workspace:
    ws = bench_workspace("domes")
    rng = np.random.default_rng(2)
    return replace(ws, patches=tuple(
        replace(p, depth_mm=p.depth_mm + (rng.random(p.shape) < SHARE) * draw(rng, p.shape))
        for p in ws.patches
    ))  # fmt: skip


@pytest.mark.parametrize("off", [0.4, -1.3])
def test_one_size_is_found(off: float) -> None:
    found = one_size_mm(with_outliers(lambda rng, shape: np.full(shape, off)), Model())
    assert found == pytest.approx(off, abs=0.02)


@pytest.mark.parametrize(
    "draw",
    [
        lambda rng, shape: rng.normal(0.0, 1.0, shape),
        lambda rng, shape: rng.uniform(-2.0, 2.0, shape),
        lambda rng, shape: rng.lognormal(-0.5, 0.6, shape),
        lambda rng, shape: rng.standard_t(2, shape),
    ],
)
def test_outliers_by_chance_have_many(draw) -> None:
    assert one_size_mm(with_outliers(draw), Model()) is None


def test_readings_without_outliers_have_none() -> None:
    assert one_size_mm(bench_workspace("domes"), Model()) is None
