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
    nats_since,
    scatter_of,
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
        )  # fmt: skip
        sizes.append(np.log(noise.sd_mm))
        told.append(level_unsure(noise))
    assert np.median(told) == pytest.approx(np.std(sizes), rel=0.4)
    assert level_unsure(replace(noise, readings=4 * noise.readings)) == pytest.approx(
        0.5 * told[-1]
    )


def since(change: float, scatter: float, doubt: float = 0.0, seed: int = 0) -> float:
    """Odds of a change since three baselines were recorded, by three recordings."""
    rng = np.random.default_rng(seed)
    seen, good = (
        [LevelChange(log=0.3 + by + np.hypot(scatter, 0.005) * x, unsure=0.005)
         for x in rng.standard_normal(3)]
        for by in (change, 0.0)
    )  # fmt: skip
    usual = 0.5 ** np.arange(len(SETTINGS.rate_sizes()))
    sizes = steady_level(good, usual / usual.sum())
    return nats_since(seen, good, sizes, doubt) + SETTINGS.log_odds("roughness_level")


def test_a_change_since_baselines_stands_out_of_their_scatter() -> None:
    assert all(since(0.06, 0.0, seed=k) > 0 for k in range(10))
    assert all(since(0.0, 0.0, seed=k) < 0 for k in range(10))
    assert sum(since(0.0, 0.03, seed=k) > 0 for k in range(10)) == 0
    # what the mean leaves of the noise may be as large
    assert since(0.06, 0.0, doubt=0.1) < 0 < since(0.6, 0.0, doubt=0.1)


def test_the_level_that_all_have_is_no_change() -> None:
    seen, good = ([LevelChange(log=h, unsure=0.01) for h in (0.0, 0.01, 0.02)] for _ in range(2))
    usual = {AGAINST_PLATES: np.full(len(SETTINGS.rate_sizes()), 0.1)}
    lifted = ([replace(c, log=c.log + 1.0) for c in changes] for changes in (seen, good))
    assert nats_since(*lifted, usual) == pytest.approx(nats_since(seen, good, usual))


def test_whitened_readings_count_each_for_itself() -> None:
    rng = np.random.default_rng(1)
    noise = calibrate(
        [rng.standard_normal((60, 60))], [np.ones((60, 60), dtype=bool)], pitch_mm=(1.0, 1.0),
        missing_share=0.0,
    )  # fmt: skip
    assert level_unsure(noise, whitened=True) == pytest.approx(1 / np.sqrt(2 * noise.readings))


def test_what_recordings_differ_by_is_their_scatter() -> None:
    rng = np.random.default_rng(0)
    found = [
        scatter_of([LevelChange(log=float(x), unsure=0.03) for x in own])
        for own in 0.1 + np.hypot(0.03, 0.2) * rng.standard_normal((200, 8))
    ]
    assert np.sqrt(np.mean(np.square(found))) == pytest.approx(0.2, rel=0.1)
    assert scatter_of([LevelChange(log=0.3, unsure=0.03)] * 4) == 0.0
    assert scatter_of([LevelChange(log=0.3, unsure=0.03)]) == 0.0
