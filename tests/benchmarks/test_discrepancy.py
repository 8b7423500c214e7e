"""How well one population is told by the others."""

import numpy as np

from benchmarks.discrepancy import UNLIKE, left_out, table
from diagnosis.discrepancy.learning import APART, learnt_apart
from diagnosis.discrepancy.population import Kind, Population

SMALL, LARGE = np.array([0.98, 0.01, 0.01]), np.array([0.01, 0.01, 0.98])


def shares(population: Population, shown: list[list[dict[str, np.ndarray]]]) -> np.ndarray:
    """Return the nats of the first population, by shares of another kind."""
    nats = left_out(population, shown, [{"share": share} for share in UNLIKE])["this", "mean"]
    return np.asarray(nats - nats[0])


def test_a_population_that_is_unlike_the_others_asks_for_a_large_share() -> None:
    sure = np.array([0.0, -9.0, -9.0]), np.array([-9.0, -9.0, 0.0])
    kinds = (
        Kind(name="this, even_x: 1", weights={"bow": SMALL, "lens": SMALL}),
        Kind(name="other: 2", weights={"bow": SMALL, "lens": LARGE}),
    )
    population = Population(kinds=kinds)
    as_others = shares(population, [[{"bow": sure[0], "lens": sure[1]}] * 4, []])
    unlike = shares(population, [[{"bow": sure[1], "lens": sure[0]}] * 4, []])
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
        ways = [{"apart_by": {"mean": by}} for by in APART]
        told = left_out(Population(kinds=kinds), [[{"bow": shown}] * 4, []], ways)
        nats = told["this", "mean"]
        assert nats.shape == (len(APART),)
        assert (nats[-1] > nats[0] + 1) == grows
        # what the others tell rightly draws their sizes no further apart
        assert (learnt_apart(told)["mean"] > 1) == grows
        assert "| this | mean | +0.0 |" in table(APART, told)
