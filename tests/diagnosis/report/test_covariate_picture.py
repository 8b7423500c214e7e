"""Readings against an effect's covariate: samples of a bow show the bow."""

from pathlib import Path

import numpy as np
import pytest

from diagnosis.diagnosis import Diagnosis
from diagnosis.report.covariate_picture import samples_of


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
