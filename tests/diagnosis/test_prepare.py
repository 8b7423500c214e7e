"""What is fitted and what is held out, from the recordings that are given."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.prepare import Inputs, prepared
from files.errors import RecipeError
from sensors.recording import Recording
from tests.support.small_parts import VIEWS, datasheet, part, record

SHEET = datasheet(60)


@pytest.fixture(scope="module")
def made() -> list[Recording]:
    scene = part("domes")
    return [
        record(scene, SHEET, [], name=f"r{k}", seed=k, profiles=40, pitch_mm=0.7, **VIEWS[k])
        for k in range(3)
    ]


def given(recordings: list[Recording], **more: object) -> Inputs:
    scene = part("domes")
    return Inputs(
        recordings=recordings, vertices_mm=scene.vertices_mm, faces=scene.faces, datasheet=SHEET,
        **more,
    )  # fmt: skip


def test_the_last_of_several_recordings_is_held_out(made: list[Recording]) -> None:
    steps: list[str] = []
    ready = prepared(given(made[:2]), [], steps.append)
    assert (ready.fitted, ready.held, ready.single) == (("r0",), ("r1",), False)
    for patch in ready.patches:
        assert patch.fit.all() == (patch.recording == 0)
        assert (patch.scored == ~patch.fit).all()
    assert steps == ["registering r0", "registering r1", "calibrating the noise"]
    assert ready.noise.sd_mm == pytest.approx(0.009, rel=0.3)  # of the bench's speckle


def test_blocks_of_a_single_recording_are_held_out(made: list[Recording]) -> None:
    ready = prepared(given(made[:1]), [], lambda _: None)
    assert ready.single
    assert ready.held == ()
    (patch,) = ready.patches
    assert patch.scored.mean() == pytest.approx(0.25, abs=0.05)
    assert not (patch.fit & patch.scored).any()


def test_baselines_are_registered_and_never_held_out(made: list[Recording]) -> None:
    good = [replace(made[2], name="r0")]  # a name of its own is not needed
    ready = prepared(given(made[:2], baselines=good), [], lambda _: None)
    (patch,) = ready.baseline
    assert patch.name == "baseline r0"
    assert patch.fit.all()
    assert ready.nominal is not None
    assert ready.nominal.sd_mm == pytest.approx(ready.noise.sd_mm, rel=0.2)


def test_the_registered_pose_takes_the_misplacement_off(made: list[Recording]) -> None:
    ready = prepared(given(made[:2]), [], lambda _: None)
    for patch in ready.patches:
        rest = patch.depth_mm - patch.plain_mm
        assert abs(np.nanmedian(rest)) < 0.2 * ready.noise.sd_mm


def test_no_recording_is_an_error_of_the_users() -> None:
    with pytest.raises(RecipeError, match="no recording to diagnose"):
        prepared(given([]), [], lambda _: None)


def test_baselines_have_the_surface_s_part_of_their_brightness_too(made: list[Recording]) -> None:
    speckled = np.random.default_rng(3).gamma(4.0, 0.25, made[1].depth_mm.shape)
    one = replace(made[1], intensity=np.where(np.isfinite(made[1].depth_mm), speckled, np.nan))
    ready = prepared(given([made[0], one], baselines=[one]), [], lambda _: None)
    (found,) = (p.view.intensity for p in ready.patches if p.name == "r1")
    (good,) = (p.view.intensity for p in ready.baseline)
    assert good is not None
    assert found is not None
    assert good == pytest.approx(found, rel=1e-5, nan_ok=True)
    assert np.nanstd(np.log(good)) < 0.3 * np.nanstd(np.log(one.intensity))
