"""A filter's evidence is that of Gaussians, and takes no spectrum for a known one that isn't."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.stats import multivariate_normal, norm

from diagnosis.claims.filtered_noise import (
    LEAKING,
    USED,
    FilterWeighed,
    _Errors,
    _walks,
    log_octaves,
    weighed,
)
from diagnosis.noise.noise_model import NoiseModel

COUNT = USED.size
LAGS = 24


def noise_of(acf: np.ndarray, *, sd_mm: float = 1.0, readings: int = 20_000) -> NoiseModel:
    return NoiseModel(
        sd_mm=sd_mm, acf=acf, tail_share=0.0, tail_sd_mm=3.0, missing_share=0.0, pitch_x_mm=0.1,
        pitch_y_mm=0.1, readings=readings,
    )  # fmt: skip


def white() -> np.ndarray:
    acf = np.zeros((2 * LAGS + 1, 2 * LAGS + 1))
    acf[LAGS, LAGS] = 1.0
    return acf


def filtered(kernel: np.ndarray) -> NoiseModel:
    """White noise of size 1 behind a linear filter along the line."""
    own = np.correlate(kernel, kernel, "full")
    acf, reach = white(), len(kernel) - 1
    acf[LAGS, LAGS - reach : LAGS + reach + 1] = own / own.max()
    return noise_of(acf, sd_mm=float(np.sqrt(own.max())))


def change(noise: NoiseModel) -> np.ndarray:
    return log_octaves(noise) - log_octaves(noise_of(white()))


def dense(own: list[np.ndarray], common: np.ndarray) -> np.ndarray:
    return block_diag(*own) + np.kron(np.ones((len(own), len(own))), common)


@pytest.fixture
def errors() -> _Errors:
    return _Errors.of([700, 1500, 4000], 3000, 0.1, 0.2)


def test_density_of_recordings_is_that_of_one_gaussian(errors):
    """One recording's errors are its own; what all have in common is there in each."""
    rest = np.random.default_rng(1).normal(scale=0.5, size=(3, COUNT))
    own = [np.linalg.inv(p) for p in errors.precision]
    for signal in (np.zeros((COUNT, COUNT)), 0.3 * _walks()[2]):
        whole = multivariate_normal(cov=dense(own, errors.common + signal)).logpdf(rest.ravel())
        assert errors.log_density(errors.together(rest), signal) == pytest.approx(
            whole + 0.5 * rest.size * np.log(2 * np.pi)
        )


def test_a_gain_that_goes_down_is_the_half_of_all_gains(errors):
    rest = np.random.default_rng(2).normal(loc=-0.2, scale=0.3, size=(3, COUNT))
    signal = 0.3 * _walks()[0]
    own = [np.linalg.inv(p) for p in errors.precision]
    whole = dense(own, errors.common + signal)
    along = np.tile(signal.mean(axis=0), 3)
    solved = np.linalg.solve(whole, along)
    below = norm.cdf(0, solved @ rest.ravel(), np.sqrt(signal.mean() - along @ solved))
    seen = errors.together(rest)
    assert errors.log_lower(seen, signal) == pytest.approx(
        float(errors.log_density(seen, signal) + np.log(2 * below))
    )
    # of both signs together, a gain has the density of any walk
    both = [np.exp(errors.log_lower(errors.together(sign * rest), signal)) for sign in (1, -1)]
    assert sum(both) == pytest.approx(2 * np.exp(errors.log_density(seen, signal)))


def test_octaves_of_white_noise_are_its_variance():
    assert log_octaves(noise_of(white(), sd_mm=3.0)) == pytest.approx(
        np.log(9.0 * (1.0 + LEAKING)), abs=1e-9
    )


KNOWN = [np.full(n, 1 / n) for n in (3, 5, 7)]
LAG = 0.6 * 0.4 ** np.arange(12)
"""A readout that lags along the line, which no window of the known ones is."""


def weighed_behind(kernel: np.ndarray) -> FilterWeighed:
    changes = np.array([[change(filtered(k))] * 2 for k in KNOWN])
    now = [replace(filtered(kernel), readings=n) for n in (8000, 12000)]
    return weighed(now, [noise_of(white())], changes)


@pytest.mark.parametrize("number", [0, 1, 2])
def test_a_known_filter_is_told_from_unknown_ones(number):
    found = weighed_behind(KNOWN[number])
    assert int(found.known.argmax()) == number
    assert found.unknown < 0.05
    assert found.factors.max() > 10


def test_a_filter_of_another_form_is_unknown():
    found = weighed_behind(LAG)
    assert found.factors.max() > 10
    assert found.unknown > 0.95


def test_what_a_mean_leaves_in_all_recordings_is_no_filter(monkeypatch):
    """Long stripes along the travel are added: a filter would take fast waves away."""
    added = np.outer([0.9, 0.15, 0.05, 0.05], [1.0, 1.0, 0.8, 0.7]).ravel()[USED]
    rng = np.random.default_rng(3)
    now = [
        replace(noise_of(white(), readings=n), acf=added + 0.1 * rng.standard_normal(COUNT))
        for n in (17_600, 16_700, 18_800)
    ]
    before = [replace(noise_of(white(), readings=19_000), acf=np.zeros(COUNT))] * 2
    monkeypatch.setattr("diagnosis.claims.filtered_noise.log_octaves", lambda noise: noise.acf)
    found = weighed(now, before, np.array([[change(filtered(k))] * 3 for k in KNOWN]))
    assert found.factors.max() < 3


def test_without_a_filter_the_smallest_size_is_likeliest():
    found = weighed_behind(np.ones(1))
    assert found.factors.argmax() == 0
    assert found.known.max() < -10


def test_a_known_median_has_the_size_of_its_change():
    """The factors of a size are those of gains of it, and of known filters of about it."""
    found = weighed_behind(KNOWN[1])
    assert np.count_nonzero(found.law != found.free) <= len(KNOWN)
    best = found.factors.argmax()
    assert found.law[best] > found.free[best]
