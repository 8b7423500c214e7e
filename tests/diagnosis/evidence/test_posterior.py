"""The posterior's algebra against dense covariance matrices."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from diagnosis.evidence.posterior import Equations, Posterior, Term

N, M = 60, 9


def problem(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    x = rng.standard_normal((N, M))
    quiet = rng.uniform(0.05, 0.3, M)
    y = x @ rng.normal(0, 0.4, M) + rng.standard_normal(N)
    return x, quiet, y


def equations(x: np.ndarray, y: np.ndarray) -> Equations:
    return Equations(matrix=x.T @ x, right=x.T @ y)


def dense(y: np.ndarray, covariance: np.ndarray) -> float:
    return float(multivariate_normal(np.zeros(len(y)), np.eye(len(y)) + covariance).logpdf(y))


@pytest.mark.parametrize("joined", [False, True])
def test_a_term_s_bayes_factor_is_the_ratio_of_marginal_densities(joined: bool) -> None:
    x, quiet, y = problem(1)
    weights = np.array([[1.0], [0.5], [-1.0]]) if joined else None
    term = Term(at=np.array([2, 3, 4]), weights=weights)
    own = x[:, 2:5] if weights is None else x[:, 2:5] @ weights
    before = (x * quiet**2) @ x.T
    active = Term(at=np.array([6, 7]))
    base = before + 0.3**2 * x[:, 6:8] @ x[:, 6:8].T
    posterior = Posterior(equations(x, y), quiet, [(active, 0.3)])
    factors = posterior.cavity(term).log_factors(np.array([0.1, 0.7]))
    for size, factor in zip((0.1, 0.7), factors, strict=True):
        truth = dense(y, base + size**2 * own @ own.T) - dense(y, base)
        assert factor == pytest.approx(truth, abs=1e-3)


def test_single_combinations_are_weighed_at_once_as_one_by_one() -> None:
    x, quiet, y = problem(3)
    cavity = Posterior(equations(x, y), quiet).cavity(Term(at=np.array([1, 2, 3])))
    columns, sizes = np.random.default_rng(5).standard_normal((3, 4)), np.array([0.1, 0.7, 3.0])
    each = cavity.log_factors_of_each(columns, sizes)
    assert each.shape == (4, 3)
    for k, factors in enumerate(each):
        alone = cavity.combined(columns[:, [k]]).log_factors(sizes)
        np.testing.assert_allclose(factors, alone, rtol=1e-9)


def test_a_term_s_gain_is_that_of_its_most_probable_value() -> None:
    """As a dense fit gains, less what it gains on readings of the noise alone."""
    x, quiet, y = problem(4)
    term, size = Term(at=np.array([2, 3])), 0.7
    own = x[:, 2:4]
    usual = np.linalg.inv(np.eye(N) + (x * quiet**2) @ x.T)
    information, pull = own.T @ usual @ own, own.T @ usual @ y
    precision = information + np.eye(2) / size**2
    mean = np.linalg.solve(precision, pull)
    ratio = np.linalg.solve(precision, information)
    idle = np.trace(ratio) - 0.5 * np.trace(ratio @ ratio)
    gain = Posterior(equations(x, y), quiet).cavity(term).gain(size)
    assert gain == pytest.approx(mean @ pull - 0.5 * mean @ information @ mean - idle, abs=1e-3)


def test_evidence_of_a_set_is_its_marginal_density() -> None:
    x, quiet, y = problem(2)
    found = equations(x, y)
    term = Term(at=np.array([0, 1]))
    more = Posterior(found, quiet, [(term, 0.5)]).log_evidence
    less = Posterior(found, quiet).log_evidence
    before = (x * quiet**2) @ x.T
    truth = dense(y, before + 0.25 * x[:, :2] @ x[:, :2].T) - dense(y, before)
    assert more - less == pytest.approx(truth, abs=1e-3)


def test_what_baselines_show_as_well_is_no_change() -> None:
    """The same departure in baseline and recordings is the instrument's; alone it is a change."""
    rng = np.random.default_rng(3)
    x = rng.standard_normal((400, 3))
    quiet, term = np.full(3, 0.5), Term(at=np.arange(3))
    shape = x @ np.array([0.6, -0.5, 0.4])
    now, before = (shape + rng.standard_normal(400) for _ in range(2))
    good = rng.standard_normal(400)
    sizes = np.array([0.5])
    known = Posterior(equations(x, now), quiet, (), equations(x, before))
    changed = Posterior(equations(x, now), quiet, (), equations(x, good))
    assert known.cavity(term).log_factors(sizes)[0] < 0
    assert changed.cavity(term).log_factors(sizes)[0] > 20


def test_coefficients_are_the_posterior_mean() -> None:
    x, quiet, y = problem(4)
    term = Term(at=np.array([1]), weights=np.array([[2.0]]))
    got = Posterior(equations(x, y), quiet, [(term, 0.5)]).coefficients()
    prior = np.diag(quiet**2)
    prior[1, 1] += (2.0 * 0.5) ** 2
    truth = np.linalg.solve(x.T @ x + np.linalg.inv(prior), x.T @ y)
    assert got == pytest.approx(truth, abs=1e-3)
