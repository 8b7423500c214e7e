"""Laplace's evidence against integrals, and sums over cells against readings one by one."""

import numpy as np
import pytest
from scipy.integrate import quad

from diagnosis.evidence.glm import Events, Responses, Squares, mode


def responses(kind: str, seed: int = 0, count: int = 300) -> tuple[Responses, np.ndarray]:
    rng = np.random.default_rng(seed)
    u = rng.uniform(-1, 1, count)
    if kind == "scale":
        squares = np.square(rng.standard_normal(count) * np.exp(0.2 * u))
        return Squares(seen=squares, number=np.ones(count)), u
    seen = rng.random(count) < np.square(0.3 + 0.15 * u)
    return Events(seen=seen.astype(float), usual=np.full(count, 0.09)), u


@pytest.mark.parametrize("kind", ["scale", "rate"])
def test_one_coefficient_s_evidence_is_its_integral(kind: str) -> None:
    of, u = responses(kind)
    size = 0.5
    at_mode = mode(of, u[:, None], np.array([size]))
    best = float(at_mode.coefficients[0])
    height = of.likelihood(best * u)[0]

    def density(b: float) -> float:
        return float(np.exp(of.likelihood(b * u)[0] - height - 0.5 * (b / size) ** 2))

    integral = quad(density, best - 3, best + 3, points=[best])[0] / (size * np.sqrt(2 * np.pi))
    assert at_mode.log_evidence == pytest.approx(height + np.log(integral), abs=0.05)


@pytest.mark.parametrize("kind", ["scale", "rate"])
def test_cells_of_one_predictor_say_what_their_readings_say(kind: str) -> None:
    of, u = responses(kind)
    owner = np.digitize(u, np.linspace(-1, 1, 9)[1:-1])
    level = np.linspace(-0.5, 0.5, 8)
    cells = of.in_cells(owner, 8)
    one = of.likelihood(level[owner])[0] - of.likelihood(np.zeros(u.size))[0]
    two = cells.likelihood(level)[0] - cells.likelihood(np.zeros(8))[0]
    assert one == pytest.approx(two, abs=1e-9)


@pytest.mark.parametrize("kind", ["scale", "rate"])
def test_a_change_taken_in_is_gone(kind: str) -> None:
    of, u = responses(kind, count=4000)
    found = mode(of, u[:, None], np.array([1.0]))
    left = mode(of.moved(u * found.coefficients[0]), u[:, None], np.array([1.0]))
    assert abs(found.coefficients[0]) > 0.1
    assert abs(left.coefficients[0]) < 0.05


@pytest.mark.parametrize("kind", ["scale", "rate"])
def test_indicators_are_fitted_as_sparse_or_dense_alike(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    of, u = responses(kind, count=600)
    columns = np.column_stack([np.ones(600), np.arange(600)[:, None] % 40 == np.arange(40)])
    sd = np.concatenate([[1.0], np.full(40, 0.3)])
    found = mode(of, columns.astype(float), sd)
    monkeypatch.setattr("diagnosis.evidence.glm.SPARSE", 0.0)
    dense = mode(of, columns.astype(float), sd)
    assert found.coefficients == pytest.approx(dense.coefficients, abs=1e-9)
    assert found.sd == pytest.approx(dense.sd)
    assert found.log_evidence == pytest.approx(dense.log_evidence)
    _, _, curve = of.likelihood(columns @ dense.coefficients)
    precision = np.diag(sd**-2.0) + (columns * curve[:, None]).T @ columns
    assert dense.sd == pytest.approx(np.sqrt(np.diag(np.linalg.inv(precision))))
