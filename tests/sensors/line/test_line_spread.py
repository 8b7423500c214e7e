"""A line that moves while it is exposed, against its closed form."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from sensors.line.line_spread import line_spread, step_between


@pytest.mark.parametrize(("sd", "way"), [(0.05, 0.3), (0.05, 0.02), (0.02, 0.5)])
def test_moments_of_a_moving_line(sd, way):
    """Mean of the way's middle, variance s² + w²/12, <η d> = s²."""
    line = line_spread(sd, 0.1, 0.1 + way)
    d, light, within = line.offsets_mm, line.light[:, 0], line.within_mm[:, 0]
    assert light.sum() == pytest.approx(1.0)
    assert d @ light == pytest.approx(0.1 + way / 2, abs=1e-5)
    # cut at four deviations; a hat adds h²/6
    assert line.variance[0] == pytest.approx(sd**2 + way**2 / 12, rel=0.02)
    assert (light * within) @ d == pytest.approx(sd**2, rel=0.05)
    assert light @ within == pytest.approx(0.0, abs=1e-5)


def test_where_in_the_line_light_lies():
    """E[η | d] of η + u = d, u even over the way, by quadrature; smoothed by the grid alone."""
    sd, way = 0.05, 0.3
    line = line_spread(sd, -way / 2, way / 2, step_mm=sd / 8)
    for k in range(0, line.offsets_mm.size, 7):
        d = line.offsets_mm[k]
        low, high = d - way / 2, d + way / 2
        weight = quad(lambda e: norm.pdf(e, scale=sd), low, high)[0]
        mean = quad(lambda e: e * norm.pdf(e, scale=sd), low, high)[0] / weight
        assert line.within_mm[k, 0] == pytest.approx(mean, abs=0.002)


def test_a_line_that_stands_is_itself():
    line = line_spread(0.05, 0.0, 0.0)
    assert np.allclose(line.within_mm[:, 0], line.offsets_mm, rtol=2e-3)
    density = norm.pdf(line.offsets_mm, scale=0.05)
    assert np.allclose(line.light[:, 0], density / density.sum(), atol=0.01)


def test_a_line_without_width_is_a_box():
    line = line_spread(0.0, 0.0, 0.4)
    assert np.allclose(line.within_mm, 0.0)
    assert line.offsets_mm @ line.light[:, 0] == pytest.approx(0.2)
    inner = line.light[2:-2, 0]
    assert np.allclose(inner, inner[0])
    assert line.variance[0] == pytest.approx(0.4**2 / 12, rel=0.05)


def test_profiles_differ_and_either_direction_is_served():
    line = line_spread(0.02, [0.0, 0.1, -0.2], [0.2, -0.1, -0.2])
    assert np.allclose(line.offsets_mm @ line.light, [0.1, 0.0, -0.2], atol=1e-5)


def test_like_exposures_meet_the_same_places():
    """Grids are multiples of one power of two from one octave to the next."""
    steps = {step_between(0.0, way) for way in (0.13, 0.18, 0.245)}
    assert steps == {step_between(0.0, 0.2)}
    assert step_between(0.05, 0.1) <= 0.05


def test_a_long_way_averages_speckle():
    """Σ (L <η>)² is s³ / (√π w²) where the ends are apart, s / (4 √π) of a standing line."""
    sd, way = 0.05, 0.8
    moving = line_spread(sd, 0.0, way, step_mm=sd / 4)
    standing = line_spread(sd, 0.0, 0.0, step_mm=sd / 4)
    assert moving.speckle[0] / standing.speckle[0] == pytest.approx(2 * sd / way, rel=0.02)
