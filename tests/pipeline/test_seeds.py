"""Named streams: the same name gives the same draws, other names independent ones."""

import numpy as np

from pipeline.seeds import stream, streams


def test_a_name_always_gives_the_same_draws():
    a = stream(0, "part", 3, "scan").random(5)
    assert (a == streams(0, "part", 3)("scan").random(5)).all()


def test_names_and_seeds_are_told_apart():
    draws = {
        stream(*names).random()
        for names in [(0, "a"), (1, "a"), (0, "a", 1), (0, "a", "1"), (0, "a1"), (0, "a", 11)]
    }
    assert len(draws) == 6


def test_streams_are_uncorrelated():
    x = np.array([stream(7, "scan", k).standard_normal(200) for k in range(50)])
    correlation = np.corrcoef(x)[np.triu_indices(50, 1)]
    # 1225 correlations of 200 samples: standard deviation 1/sqrt(200)
    assert abs(correlation.mean()) < 4 / np.sqrt(200 * len(correlation))
    assert abs(correlation.std() * np.sqrt(200) - 1) < 0.1
