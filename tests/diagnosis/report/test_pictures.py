"""What the pictures draw: samples of a bow, and the profile that a model improves most."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from diagnosis.diagnose import Diagnosis
from diagnosis.report.covariate_picture import covariate_picture, samples_of
from diagnosis.report.map_pictures import mismatch_map, residual_maps
from diagnosis.report.profile_picture import most_improved, profile_picture


def test_samples_of_a_bow_show_the_bow(diagnosed: tuple[Diagnosis, Path]) -> None:
    result = diagnosed[0]
    bow = result.effects[0]
    samples = samples_of(result, bow)
    assert samples is not None
    # the residual without the bow is the bow's change of the mean, and noise
    slope = samples.change_mm @ samples.residual_mm / (samples.change_mm @ samples.change_mm)
    assert slope == pytest.approx(1.0, abs=0.1)
    rest = samples.residual_mm - samples.change_mm
    assert rest.std() == pytest.approx(np.median(samples.sd_mm), rel=0.2)
    # and it is even in the place on the line
    x = samples.covariate
    even = np.polyfit(x / np.abs(x).max(), samples.change_mm, 2)
    assert abs(even[0]) > 5 * abs(even[1])


def test_each_picture_is_a_png(diagnosed: tuple[Diagnosis, Path]) -> None:
    result = diagnosed[0]
    for picture in (
        mismatch_map(result), residual_maps(result), profile_picture(result),
        covariate_picture(result, result.effects[0]),
    ):  # fmt: skip
        assert picture is not None
        assert picture.startswith(b"\x89PNG")


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
