"""Perlin noise against its own equations, closed forms and symmetries."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

from sensors.noise.heights import HeightMap
from sensors.noise.perlin import (
    GRID_LIMIT,
    OCTAVE_SD,
    PerlinField,
    gradients,
    grid_pitch,
    smoothstep,
)
from sensors.noise.spectrum import power_spectrum
from tests.support.perlin_spectrum import OCTAVE_MAX, octave_line_spectrum, octave_spectrum


def one_octave(cell: float = 1.0, **more: object) -> PerlinField:
    return PerlinField(amplitude_mm=1.0, cell_x_mm=cell, cell_y_mm=cell, octaves=1, **more)


def test_field_is_the_papers_equations_4_to_8() -> None:
    field = one_octave(aligned=True, band_limited=False)
    x = np.sort(np.random.default_rng(1).uniform(-3.0, 5.0, 40))
    y = np.array([0.3, -1.7, 2.9, 2.2, 0.3])  # rows in any order
    got = field.sample(x, y, np.random.default_rng(5))
    key = np.random.default_rng(5).integers(0, 2**64, size=1, dtype=np.uint64)[0]
    corners = np.arange(-4, 8)
    gx, gy = np.empty((12, 12)), np.empty((12, 12))
    for row in range(12):
        gradients(key, row - 4, corners, gx[row], gy[row])
    np.testing.assert_allclose(np.hypot(gx, gy), 1.0, atol=1e-12)

    def influence(i: int, j: int, px: float, py: float) -> float:
        return float(gx[j + 4, i + 4] * (px - i) + gy[j + 4, i + 4] * (py - j))

    for b, py in enumerate(y):
        for a, px in enumerate(x):
            i, j = math.floor(px), math.floor(py)
            fade_x, fade_y = (float(smoothstep(np.array(t))) for t in (px - i, py - j))
            n0 = influence(i, j, px, py)
            n0 += fade_x * (influence(i + 1, j, px, py) - n0)
            n1 = influence(i, j + 1, px, py)
            n1 += fade_x * (influence(i + 1, j + 1, px, py) - n1)
            assert got[b, a] == pytest.approx(n0 + fade_y * (n1 - n0), abs=1e-12)


def test_octaves_add_with_persistence_and_doubled_frequency() -> None:
    x, y = np.linspace(0.0, 9.0, 50), np.linspace(0.0, 7.0, 30)
    summed = PerlinField(
        amplitude_mm=3.0, cell_x_mm=1.0, cell_y_mm=1.0, octaves=2, persistence=0.4,
        aligned=True, band_limited=False,
    ).sample(x, y, np.random.default_rng(2))
    keys = np.random.default_rng(2).integers(0, 2**64, size=2, dtype=np.uint64)

    class Key:
        def __init__(self, key: np.uint64) -> None:
            self.key = key

        def integers(self, *args: object, **kwargs: object) -> np.ndarray:
            return np.array([self.key])

        def random(self, shape: tuple[int, int]) -> np.ndarray:
            return np.zeros(shape)

    parts = [
        one_octave(cell, aligned=True, band_limited=False).sample(x, y, Key(key))  # type: ignore[arg-type]
        for cell, key in zip((1.0, 0.5), keys, strict=True)
    ]
    np.testing.assert_allclose(summed, 3.0 * (parts[0] + 0.4 * parts[1]), atol=1e-12)


def test_standard_deviation_is_the_closed_form() -> None:
    x, y = np.arange(400) * 0.23, np.arange(300) * 0.23
    for persistence in (0.3, 0.8):
        field = PerlinField(
            amplitude_mm=1.0, cell_x_mm=1.7, cell_y_mm=2.3, octaves=3, persistence=persistence
        )
        variance = np.mean(
            [field.sample(x, y, np.random.default_rng(seed)).var() for seed in range(8)]
        )
        assert math.sqrt(variance) == pytest.approx(field.sd(0.23, 0.23), rel=0.01)
        gains = persistence ** np.arange(3)
        assert field.sd(0.23, 0.23) == pytest.approx(OCTAVE_SD * math.sqrt(np.sum(gains**2)))


def test_one_octave_stays_within_its_bound_and_nears_it() -> None:
    x = y = np.arange(1200) * 0.27
    highest = np.abs(one_octave().sample(x, y, np.random.default_rng(3))).max()
    assert 0.9 * OCTAVE_MAX < highest <= OCTAVE_MAX


def test_aligned_lattice_is_zero_at_control_points_and_shifted_is_not() -> None:
    x = y = np.arange(20) * 2.0
    aligned = one_octave(2.0, aligned=True, band_limited=False)
    assert np.abs(aligned.sample(x, y, np.random.default_rng(4))).max() == 0.0
    shifted = one_octave(2.0, band_limited=False).sample(x, y, np.random.default_rng(4))
    assert np.abs(shifted).max() > 0.05


def test_second_derivative_is_continuous_at_lattice_lines() -> None:
    """The jump of the one-sided second differences falls with the step, as for C2 (not C1)."""
    field = one_octave(aligned=True, band_limited=False)
    y = np.linspace(0.1, 30.9, 200)

    def jump(h: float) -> tuple[float, float]:
        x = 5.0 + np.arange(-2, 3) * h
        z = field.sample(x, y, np.random.default_rng(6))
        left = (z[:, 0] - 2 * z[:, 1] + z[:, 2]) / h**2
        right = (z[:, 2] - 2 * z[:, 3] + z[:, 4]) / h**2
        across = field.sample(y, x, np.random.default_rng(6)).T
        up = (across[:, 0] - 2 * across[:, 1] + across[:, 2]) / h**2
        down = (across[:, 2] - 2 * across[:, 3] + across[:, 4]) / h**2
        return float(np.abs(right - left).max()), float(np.abs(down - up).max())

    coarse, fine = jump(4e-3), jump(1e-3)
    for along in (0, 1):
        assert fine[along] == pytest.approx(coarse[along] / 4.0, rel=0.1)
        assert fine[along] < 0.2  # a cubic fade would leave jumps of several units


def mean_spectrum(field: PerlinField, axis: int) -> tuple[np.ndarray, np.ndarray]:
    x = y = np.arange(256) * 0.25
    densities = []
    for seed in range(24):
        z = field.sample(x, y, np.random.default_rng(seed))
        frequency, density = power_spectrum(z, 0.25, axis)
        densities.append(density)
    return frequency, np.mean(densities, axis=0)


@pytest.mark.parametrize("axis", [0, 1])
def test_spectrum_is_the_familys_and_has_no_lines_at_the_control_points(axis: int) -> None:
    """Every single frequency stays at the closed form, the lattice's 1, 2 per cell included."""
    frequency, density = mean_spectrum(one_octave(), axis)
    keep = (frequency > 0.1) & (frequency < 1.05)  # beyond, what leaks through the window shows
    expected = 2.0 * octave_line_spectrum(frequency[keep])
    excess_db = 10.0 * np.log10(density[keep] / expected)
    assert np.abs(excess_db).max() < 1.5
    at_lattice = np.abs(frequency[keep] - 1.0) < 0.03
    assert at_lattice.any()
    assert excess_db[at_lattice].max() < 1.0


def test_line_spectrum_is_the_plane_spectrum_summed_over_the_other_axis() -> None:
    f, other = np.array([0.2, 0.5, 0.9]), np.linspace(-12.0, 12.0, 4001)
    summed = octave_spectrum(f[:, None], other[None, :]).sum(axis=1) * (other[1] - other[0])
    np.testing.assert_allclose(summed, octave_line_spectrum(f), rtol=1e-3)
    assert np.sum(octave_line_spectrum(other)) * (other[1] - other[0]) == pytest.approx(
        OCTAVE_SD**2, rel=1e-3
    )


def test_noise_looks_alike_in_all_directions_that_a_square_lattice_allows() -> None:
    """Equal slopes along x and y and along both diagonals, the latter by what the family implies.

    Unlike points of the lattice, gradients have no direction, so that the covariance is
    C = ½ (A(dx) B(dy) + B(dx) A(dy)), A and B the autocorrelations of ramp and bump.
    """
    t = np.linspace(-1.5, 1.5, 30_001)
    bump = np.where(np.abs(t) < 1.0, 1.0 - smoothstep(np.abs(t)), 0.0)

    def autocorrelation(values: np.ndarray, lag: float) -> float:
        return float(np.sum(values * np.interp(t + lag, t, values)) * (t[1] - t[0]))

    a0, a, b0, b = (
        autocorrelation(v, lag) for v in (t * bump, bump) for lag in (0.0, 0.5)
    )
    along, diagonal = (a0 * b0 - 0.5 * (a * b0 + b * a0)) / 0.25, (a0 * b0 - a * b) / 0.5
    x = y = np.arange(500) * 0.1
    square = np.zeros(4)
    for seed in range(10):
        z = one_octave().sample(x, y, np.random.default_rng(seed))
        square += (
            np.mean((z[:, 5:] - z[:, :-5]) ** 2) / 0.25,
            np.mean((z[5:] - z[:-5]) ** 2) / 0.25,
            np.mean((z[5:, 5:] - z[:-5, :-5]) ** 2) / 0.5,
            np.mean((z[5:, :-5] - z[:-5, 5:]) ** 2) / 0.5,
        )
    assert square[0] == pytest.approx(square[1], rel=0.04)
    assert square[2] == pytest.approx(square[3], rel=0.04)
    assert square[0] / 10 == pytest.approx(2.0 * along, rel=0.03)
    assert square[2] / 10 == pytest.approx(2.0 * diagonal, rel=0.03)


def test_gradients_have_no_preferred_direction() -> None:
    gx, gy = np.empty(200_000), np.empty(200_000)
    gradients(np.uint64(12345), 7, np.arange(200_000) - 100_000, gx, gy)
    counts = np.histogram(np.arctan2(gy, gx), bins=36, range=(-np.pi, np.pi))[0]
    expected = gx.size / 36
    assert np.sum((counts - expected) ** 2 / expected) < 70.0  # 99.96 % of chi² with 35
    assert abs(np.mean(gx[1:] * gx[:-1])) < 0.01


def test_equal_positions_have_equal_heights_and_equal_seeds_equal_fields() -> None:
    field = PerlinField(amplitude_mm=1.0, cell_x_mm=3.0, cell_y_mm=4.0)
    x, y = np.arange(200.0), np.arange(100.0)
    whole = field.sample(x, y, np.random.default_rng(8))
    part = field.sample(x[40:90], y[20:60], np.random.default_rng(8))
    np.testing.assert_array_equal(part, whole[20:60, 40:90])
    np.testing.assert_array_equal(field.sample(x, y, np.random.default_rng(8)), whole)
    assert not np.array_equal(field.sample(x, y, np.random.default_rng(9)), whole)
    backwards = field.sample(x, y[::-1], np.random.default_rng(8))
    np.testing.assert_array_equal(backwards, whole[::-1])


def test_octaves_that_the_grid_cannot_show_are_left_out() -> None:
    field = PerlinField(amplitude_mm=1.0, cell_x_mm=8.0, cell_y_mm=8.0, octaves=6)
    assert len(field.drawn_octaves(0.1, 0.1)) == 6
    assert [c for _, c, _ in field.drawn_octaves(2.0, 2.0)] == [8.0, 4.0, 2.0 * GRID_LIMIT]
    assert field.drawn_octaves(20.0, 20.0) == [(1.0, 20.0 * GRID_LIMIT, 20.0 * GRID_LIMIT)]
    # each axis on its own
    assert [c for _, _, c in field.drawn_octaves(0.1, 20.0)] == [20.0 * GRID_LIMIT] * 6


def test_band_limit_takes_out_the_beat_of_98_control_points_on_100_profiles() -> None:
    x, y = np.arange(501) * 22.5 / 501, np.arange(100) * 22.5 / 100
    cell = 22.5 / 98
    bands = {}
    for limited in (False, True):
        field = one_octave(cell, band_limited=limited, aligned=not limited)
        variance = np.mean(
            [field.sample(x, y, np.random.default_rng(s)).var(axis=1) for s in range(30)], axis=0
        )
        # control points and profiles fall together and apart once in 50 profiles
        wave = np.exp(-2j * np.pi * np.arange(100) / 50)
        bands[limited] = 2.0 * abs(np.mean(variance * wave)) / variance.mean()
    assert bands[False] > 0.3
    assert bands[True] < 0.1


def test_height_map_gives_the_standardised_field_its_own_distribution() -> None:
    heights = HeightMap(knots=(-4.0, 0.0, 4.0), values=(-4.0, 0.0, 4.0))
    field = PerlinField(amplitude_mm=0.02, cell_x_mm=3.0, cell_y_mm=3.0, heights=heights)
    x = y = np.arange(600.0)
    assert field.sample(x, y, np.random.default_rng(1)).std() == pytest.approx(0.02, rel=0.03)
    for pitch in (1.0, 10.0):  # whatever the grid can show
        z = field.sample(x * pitch, y * pitch, np.random.default_rng(1))
        assert z.std() == pytest.approx(0.02, rel=0.03)


@given(
    st.lists(st.floats(0.05, 2.0), min_size=3, max_size=12),
    st.lists(st.floats(0.0, 3.0), min_size=12, max_size=12),
)
@example([1.0] * 3, [0.0, 0.0, 2.2e-311, *[0.0] * 9])
@settings(max_examples=60, deadline=None)
def test_height_map_never_falls_and_meets_its_knots(steps: list[float], rises: list[float]) -> None:
    knots = np.cumsum(steps)
    values = np.cumsum(rises[: knots.size])
    heights = HeightMap(knots=tuple(knots.tolist()), values=tuple(values.tolist()))
    np.testing.assert_allclose(heights(knots), values, atol=1e-9)
    u = np.linspace(knots[0] - 1.0, knots[-1] + 1.0, 700)
    assert np.diff(heights(u)).min() >= -1e-9
    inner = (u > knots[1]) & (u < knots[-2])
    with np.errstate(over="ignore"):  # SciPy's, for secants below the normal numbers
        reference = PchipInterpolator(knots, values)(u[inner])
    np.testing.assert_allclose(heights(u)[inner], reference, atol=1e-9)


def test_height_map_goes_straight_on_beyond_its_ends() -> None:
    heights = HeightMap(knots=(0.0, 1.0, 2.0), values=(0.0, 1.0, 3.0))
    np.testing.assert_allclose(heights(np.array([-2.0, 4.0])), [-2.0, 7.0])
    assert np.isnan(heights(np.array([np.nan]))).all()


@pytest.mark.parametrize(
    "wrong",
    [{"cell_x_mm": 0.0}, {"cell_y_mm": -1.0}, {"octaves": 0}, {"persistence": 1.5}],
)
def test_field_refuses_what_has_no_meaning(wrong: dict[str, float]) -> None:
    good = {"amplitude_mm": 1.0, "cell_x_mm": 1.0, "cell_y_mm": 1.0}
    with pytest.raises(ValueError, match=r"positive|octave"):
        PerlinField(**{**good, **wrong})


@pytest.mark.parametrize(
    ("knots", "values"),
    [((0.0,), (0.0,)), ((0.0, 0.0), (0.0, 1.0)), ((0.0, 1.0), (1.0, 0.0)), ((0.0, 1.0), (0.0,))],
)
def test_height_map_refuses_what_falls(knots: tuple[float, ...], values: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match=r"knots"):
        HeightMap(knots=knots, values=values)


def test_grid_pitch_is_the_usual_step() -> None:
    assert grid_pitch(np.array([3.0])) == 0.0
    assert grid_pitch(np.array([3.0, 2.0, 1.0, 0.0, -7.0])) == 1.0
