"""A change of the noise's level, against plates and against claims."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from diagnosis.evidence.noise_level import (
    AGAINST_PLATES,
    LevelChange,
    claimed_sizes,
    level_factors,
    level_nats,
    level_unsure,
    steady_level,
)
from diagnosis.fields import Field
from diagnosis.noise.noise_model import calibrate
from diagnosis.settings import SETTINGS


def test_factors_are_those_of_two_gaussians() -> None:
    sizes = SETTINGS.rate_sizes()
    direct = [norm.logpdf(0.1, 0, np.hypot(0.02, s)) - norm.logpdf(0.1, 0, 0.02) for s in sizes]
    assert level_factors(0.1, 0.02) == pytest.approx(direct)


def odds(log: float, unsure: float, usual: dict[str, Field]) -> float:
    nats = level_nats(LevelChange(log=log, unsure=unsure), usual)
    return nats + SETTINGS.log_odds("roughness_level")


def test_what_good_instruments_have_is_no_change() -> None:
    sizes = SETTINGS.rate_sizes()
    usual = {AGAINST_PLATES: np.where(sizes < 0.05, 1.0, 1e-6) / (sizes < 0.05).sum()}
    assert odds(0.03, 0.01, usual) < 0 < odds(0.3, 0.01, usual)
    # as large a change hardly known is none
    assert odds(0.3, 0.2, usual) < 0


def test_a_claim_may_be_off_by_more_than_a_plate() -> None:
    assert odds(0.08, 0.01, claimed_sizes()) < 0 < odds(0.5, 0.01, claimed_sizes())


@pytest.mark.parametrize(("scatter", "told"), [(0.003, True), (0.06, False)])
def test_noise_that_changes_between_baselines_is_not_called_changed_for_as_much(
    scatter: float, told: bool
) -> None:
    usual = 0.5 ** np.arange(len(SETTINGS.rate_sizes()))
    good = [LevelChange(log=k * scatter, unsure=0.005) for k in (-1.0, 1.0, 0.2)]
    sizes = steady_level(good, usual / usual.sum())
    assert sum(sizes[AGAINST_PLATES]) == pytest.approx(1.0)
    assert (odds(0.1, 0.005, sizes) > 0) is told
    assert odds(1.0, 0.005, sizes) > 0
    # what they have in common is their mean: the nominal noise's own
    shifted = [LevelChange(log=c.log + 0.3, unsure=c.unsure) for c in good]
    assert steady_level(shifted, usual / usual.sum())[AGAINST_PLATES] == pytest.approx(
        sizes[AGAINST_PLATES]
    )


def test_the_deviation_of_a_level_is_that_of_repeated_fields() -> None:
    rng = np.random.default_rng(0)
    kernel = np.array([0.5, 1.0, 0.5]) / np.sqrt(1.5)
    sizes, told = [], []
    for _ in range(60):
        white = rng.standard_normal((60, 62))
        field = sum(w * white[:, k : 60 + k] for k, w in enumerate(kernel))
        noise = calibrate(
            [field], [np.ones(field.shape, dtype=bool)], pitch_mm=(1.0, 1.0), missing_share=0.0,
            from_reference=False,
        )  # fmt: skip
        sizes.append(np.log(noise.sd_mm))
        told.append(level_unsure(noise))
    assert np.median(told) == pytest.approx(np.std(sizes), rel=0.4)
    assert level_unsure(replace(noise, readings=4 * noise.readings)) == pytest.approx(
        0.5 * told[-1]
    )
