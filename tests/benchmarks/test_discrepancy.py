"""How well one population is told by the others."""

import numpy as np

from benchmarks.discrepancy import UNLIKE, left_out
from diagnosis.discrepancy.population import Kind, Population

SMALL, LARGE = np.array([0.98, 0.01, 0.01]), np.array([0.01, 0.01, 0.98])


def nats_of(population: Population, shown: list[list[dict[str, np.ndarray]]]) -> np.ndarray:
    """Read the nats of the first population's row."""
    row = left_out(population, shown).splitlines()[2]
    assert row.startswith("| this | mean |")
    return np.array([float(cell) for cell in row.split("|")[3:-1]])


def test_a_population_that_is_unlike_the_others_asks_for_a_large_share() -> None:
    sure = np.array([0.0, -9.0, -9.0]), np.array([-9.0, -9.0, 0.0])
    kinds = (
        Kind(name="this, even_x: 1", weights={"bow": SMALL, "lens": SMALL}),
        Kind(name="other: 2", weights={"bow": SMALL, "lens": LARGE}),
    )
    population = Population(kinds=kinds)
    as_others = nats_of(population, [[{"bow": sure[0], "lens": sure[1]}] * 4, []])
    unlike = nats_of(population, [[{"bow": sure[1], "lens": sure[0]}] * 4, []])
    assert as_others.shape == (len(UNLIKE),)
    assert np.all(np.diff(as_others) <= 0)
    assert as_others[-1] < -1
    assert np.all(np.diff(unlike) >= 0)
    assert unlike[-1] > 1
