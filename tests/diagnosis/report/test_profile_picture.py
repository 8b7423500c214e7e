"""The profile that a model improves most is the one that is shown."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from diagnosis.diagnosis import Diagnosis
from diagnosis.report.profile_picture import most_improved, profile_picture


def test_the_profile_that_improves_most_is_shown(diagnosed: tuple[Diagnosis, Path]) -> None:
    result = diagnosed[0]
    before = [np.array(r) for r in result.before.residuals_mm]
    before[0][17] += 0.5
    worse = replace(result, before=replace(result.before, residuals_mm=tuple(before)))
    assert most_improved(worse, reach_mm=1.0) == (0, 17)


def test_without_held_out_readings_no_profile_is_shown(diagnosed: tuple[Diagnosis, Path]) -> None:
    result = diagnosed[0]
    none = tuple(np.full_like(r, np.nan) for r in result.before.residuals_mm)
    empty = replace(
        result, before=replace(result.before, residuals_mm=none),
        after=replace(result.after, residuals_mm=none),
    )  # fmt: skip
    assert profile_picture(empty) is None
