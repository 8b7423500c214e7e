"""How well one population is told by the others."""

import numpy as np

from benchmarks.discrepancy import STEPS, UNLIKE, left_out
from diagnosis.discrepancy.population import Kind, Population

SMALL, LARGE = np.array([0.98, 0.01, 0.01]), np.array([0.01, 0.01, 0.98])


def nats_of(
    population: Population, shown: list[list[dict[str, np.ndarray]]], table: int = 0
) -> np.ndarray:
    """Read the nats of the first population's row: by shares, or by how far sizes lie apart."""
    rows = [r for r in left_out(population, shown).splitlines() if r.startswith("| this | mean |")]
    return np.array([float(cell) for cell in rows[table].split("|")[3:-1]])


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


def test_a_population_whose_sizes_lie_beyond_the_others_asks_for_them_further_apart() -> None:
    sizes = 15
    small, sure = np.full(sizes, 1e-6), np.full(sizes, -40.0)
    small[2] = 1 - small.sum()
    kinds = tuple(Kind(name=name, weights={"bow": small}) for name in ("this: 1", "other: 2"))
    for place, grows in ((2, False), (7, True)):
        shown = sure.copy()
        shown[place] = 0.0
        nats = nats_of(Population(kinds=kinds), [[{"bow": shown}] * 4, []], table=1)
        assert nats.shape == (len(STEPS),)
        assert nats[-1] > 1 if grows else nats[-1] < 0
