"""Means over bins against means that are known, and bytes of a picture."""

import numpy as np

from diagnosis.report.canvas import binned, binned_medians, figure_of, png


def test_means_of_bins_are_those_of_their_readings() -> None:
    x = np.repeat(np.arange(10.0), 40)
    y = 3.0 * x
    centre, mean, low, high = binned(x, y)
    assert np.allclose(mean, 3.0 * centre)
    assert (low <= mean).all()
    assert (mean <= high).all()


def test_the_interval_of_a_bin_is_that_of_the_mean_of_its_readings() -> None:
    rng = np.random.default_rng(3)
    x = rng.uniform(0, 1, 240_000)
    _, mean, low, high = binned(x, rng.normal(0.0, 2.0, x.size), bins=24)
    # two standard errors, 2 · 2 / sqrt(readings of a bin)
    assert np.allclose(high - mean, 4.0 / np.sqrt(x.size / 24), rtol=0.05)
    assert ((low < 0) & (high > 0)).mean() > 0.8


def test_bins_of_few_readings_are_left_out() -> None:
    x = np.concatenate([np.linspace(0, 1, 500), [9.0]])
    centre, _, _, _ = binned(x, x)
    assert centre.max() < 2.0


def test_a_figure_is_a_png_and_the_same_every_time() -> None:
    def drawn() -> bytes:
        figure, (axis,) = figure_of(2.0, 1.0)
        axis.plot([0, 1], [0, 1])
        return png(figure)

    assert drawn().startswith(b"\x89PNG")
    assert drawn() == drawn()


def test_medians_of_bins_ignore_a_few_huge_values() -> None:
    x = np.repeat(np.arange(10.0), 40)
    y = 3.0 * x
    y[::20] = 1e6
    centre, median, count = binned_medians(x, y)
    assert np.allclose(median, 3.0 * centre)
    assert (count == 40).all()
