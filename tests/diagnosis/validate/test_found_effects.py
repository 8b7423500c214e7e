"""The sensor's file that a diagnosis writes predicts what the diagnosis predicted."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.model.model import Model
from diagnosis.physics.uncertainty import Estimate
from diagnosis.predict.prediction import law_of
from diagnosis.validate.found_effects import at_limits, heldout_gains, plainly_found, sheet_with
from diagnosis.validate.heldout import judge
from sensors.effects import effects_of
from sensors.effects.edge_mixing import EdgeMixing
from sensors.effects.finite_spot import FiniteSpot
from sensors.effects.line_bow import LineBow
from sensors.effects.motion_blur import MotionBlur
from sensors.model import SensorModel
from sensors.view.view import View
from tests.support.effect_case import bench_workspace
from tests.support.small_parts import datasheet, part, poses

LISTED = (
    {"name": "finite_spot", "line_sd_um": 60.0},
    {"name": "edge_mixing", "line_sd_um": 40.0},
)


def test_a_wider_line_found_by_one_effect_is_written_for_all() -> None:
    sheet = datasheet(100, LISTED)
    found = (EdgeMixing(line_sd_um=80.0), LineBow(sag_um=30.0))
    written = sheet_with(sheet, found)
    assert [e.name for e in effects_of(written)] == ["finite_spot", "edge_mixing", "line_bow"]
    assert effects_of(written)[0].line_sd_um == 120.0
    time = np.arange(40) / 200.0
    scan = poses(40, pitch_mm=0.3)
    as_found = law_of(View(part("steps"), SensorModel(sheet), scan, time), found, None)
    as_written = law_of(View(part("steps"), SensorModel(written), scan, time), (), None)
    assert np.array_equal(as_found.mean_mm, as_written.mean_mm, equal_nan=True)


def test_a_line_wider_by_now_is_written_beside_what_was_measured() -> None:
    sheet = datasheet(100, LISTED)
    found = (FiniteSpot(line_sd_um=60.0, beam_um=80.0),)
    written = sheet_with(sheet, found)
    assert effects_of(written) == (*found, EdgeMixing(line_sd_um=40.0))
    time = np.arange(40) / 200.0
    scan = poses(40, pitch_mm=0.3)
    plain, as_found = (law_of(View(part("steps"), SensorModel(sheet), scan, time), e, None).mean_mm
                       for e in ((), found))  # fmt: skip
    as_written = law_of(View(part("steps"), SensorModel(written), scan, time), (), None)
    assert np.nanmax(np.abs(as_found - plain)) > 0.01
    assert np.array_equal(as_found, as_written.mean_mm, equal_nan=True)


def test_what_was_not_found_stays_as_it_was_written() -> None:
    sheet = datasheet(100, LISTED)
    assert sheet_with(sheet, (LineBow(sag_um=30.0),)).effects[:2] == sheet.effects


def test_a_number_where_the_catalogue_ends_is_said_to_be_so() -> None:
    low, high = LineBow().parameter("sag_um").low, LineBow().parameter("sag_um").high
    for value, notes in ((0.5 * high, 0), (high, 1), (low, 1), (0.0, 0)):
        sag = Estimate(value=value, low=low, high=high)
        found = plainly_found(LineBow(sag_um=value), 1.0, {"sag_um": sag}, probability=0.9)
        said = at_limits([found])
        assert len(said) == notes
        assert all("line_bow" in note and "sag_um" in note for note in said)


def test_a_level_that_is_freed_is_no_gain_of_an_effect() -> None:
    """Noise twice as large as was calibrated, and a blur of no length that lets it be so."""
    ws = bench_workspace("domes")
    small = replace(ws, noise=replace(ws.noise, sd_mm=0.5 * ws.noise.sd_mm))
    blur = MotionBlur(exposure_ms=1e-4, flicker=0.0, stamped="middle")
    model = small.levelled(Model(effects=(blur,)))
    assert model.level == pytest.approx(2.0, rel=0.1)
    held = [replace(p, scored=p.fit) for p in small.patches]
    gains, after = heldout_gains(
        small, model, lambda m: judge(held, small.noise, m, share_own=False)
    )
    assert abs(gains["motion_blur"]) < 1e-3
    assert judge(held, small.noise, Model(), share_own=False).log_score > after.log_score + 0.1
