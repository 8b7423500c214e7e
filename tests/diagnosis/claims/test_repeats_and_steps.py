"""Profiles twice and coarse steps are seen in the readings' own form."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.claims import repeats_and_steps
from diagnosis.discrepancy.population import population
from diagnosis.validate.found_effects import FoundEffect
from sensors.datasheet import Datasheet
from sensors.recording import Recording
from tests.support.small_parts import datasheet, part, record


def delivered(
    recordings: list[Recording], sheet: Datasheet, notes: list[str],
    baselines: list[Recording] | None = None, *, noise_mm: float = 0.01,
) -> list[FoundEffect]:  # fmt: skip
    return repeats_and_steps.delivered(
        recordings, sheet, notes, baselines or [], noise_mm=noise_mm,
        known=population().of_files(sheet.columns),
    )  # fmt: skip


@pytest.fixture(scope="module")
def plain() -> Recording:
    return record(part("domes"), datasheet(100), [], name="a", seed=3, profiles=60, pitch_mm=0.7)


def test_plain_readings_have_nothing(plain: Recording) -> None:
    notes: list[str] = []
    assert delivered([plain], datasheet(100), notes) == []
    assert notes == []


@pytest.mark.parametrize("coarse", ["floor", "round", "reciprocal"])
def test_a_coarse_step_is_measured(plain: Recording, coarse: str) -> None:
    z, step = plain.depth_mm, 0.05
    middle = float(np.nanmedian(z))
    cut = {
        "floor": np.floor(z / step) * step,
        "round": np.round(z / step) * step,
        "reciprocal": middle**2 / step / np.round(middle**2 / step / z),
    }[coarse]
    (found,) = delivered([replace(plain, depth_mm=cut)], datasheet(100), [])
    assert found.name == "axis_quantisation"
    assert found.probability > 0.9
    assert found.parameters["step_um"].value == pytest.approx(50.0, rel=0.1)


def test_repeated_profiles_are_counted(plain: Recording) -> None:
    depth = plain.depth_mm.copy()
    depth[10:60:10] = depth[9:59:10]
    notes: list[str] = []
    (found,) = delivered([replace(plain, depth_mm=depth)], datasheet(100), notes)
    assert found.name == "row_repeat"
    assert found.parameters["share"].value == pytest.approx(5 / 60)
    assert "5 of 60 profiles repeat" in notes[0]


def test_a_stray_repeated_profile_is_noted_alone() -> None:
    made = record(part("domes"), datasheet(60), [], name="r", seed=4, profiles=200, pitch_mm=0.2)
    depth = made.depth_mm.copy()
    depth[40] = depth[39]
    notes: list[str] = []
    assert delivered([replace(made, depth_mm=depth)], datasheet(60), notes) == []
    assert "1 of 200 profiles" in notes[0]


def test_what_a_good_instrument_delivers_is_no_fault(plain: Recording) -> None:
    coarse = replace(plain, depth_mm=np.round(plain.depth_mm / 0.05) * 0.05)
    notes: list[str] = []
    assert delivered([coarse], datasheet(100), notes, [coarse]) == []
    assert "axis_quantisation: the baselines have it, too" in notes
    assert len(delivered([coarse], datasheet(100), [], [plain])) == 1


def test_a_step_far_below_the_noise_is_noted_alone(plain: Recording) -> None:
    coarse, notes = replace(plain, depth_mm=np.round(plain.depth_mm / 0.01) * 0.01), []
    assert delivered([coarse], datasheet(100), notes, noise_mm=0.2) == []
    assert "depths come in steps of about 10 µm" in notes[0]
    assert "no more than good instruments have" in notes[1]
    assert len(delivered([coarse], datasheet(100), [], noise_mm=0.01)) == 1
