"""Other makes: readings at even places are those of the surface there, and files are nominal."""

import numpy as np
import pytest

from challenge.cases.files import OPTIONAL
from challenge.cases.makes import Make, first_make, other_make


def make_of(even_step: float) -> Make:
    device = other_make(np.random.default_rng(3)).device
    return Make(device=device, artefact=False, even_step=even_step)


def tilted(make: Make, slope: float) -> np.ndarray:
    """Depth along each ray of a plane that leans along the line."""
    camera = make.device.camera
    ray = np.tan(camera.angles_rad())
    return (camera.working_distance_mm / (1 - slope * ray))[None].repeat(3, 0).astype(np.float32)


@pytest.mark.parametrize("even_step", [0.7, 1.0, 1.5])
def test_a_plane_at_even_places_is_the_plane(even_step):
    make, slope = make_of(even_step), 0.2
    depth, light = make.delivered(tilted(make, slope), np.ones((3, make.device.camera.columns)))
    x = make.even_x_mm()
    truth = make.device.camera.working_distance_mm + slope * x
    inside = np.abs(x) < 0.9 * np.abs(x).max()
    of_rays = 2 * np.abs(x).max() / (make.device.camera.columns - 1)
    assert x[1] - x[0] == pytest.approx(even_step * of_rays, rel=0.01)
    assert np.abs(depth - truth)[:, inside].max() < 1e-4
    assert (light[np.isfinite(depth)] == 1).all()


def test_no_reading_is_made_where_none_is_near():
    make = make_of(1.0)
    depth = tilted(make, 0.0)
    depth[:, 40:60] = np.nan
    found, light = make.delivered(depth, np.ones_like(depth))
    gap = np.isnan(found[0])
    assert 18 <= gap.sum() <= 22
    assert (light[:, gap] == 0).all()


def test_rays_are_delivered_as_they_are():
    make = first_make(np.random.default_rng(1))
    depth, light = tilted(make, 0.1), np.ones((3, make.device.camera.columns), np.float32)
    assert make.delivered(depth, light) == (depth, light)
    assert make.even_x_mm() is None


def test_makes_differ_and_state_nominal_widths():
    made = [other_make(np.random.default_rng(k)) for k in range(40)]
    assert len({m.device.finder.kind for m in made}) == 5
    steps = [m.even_step for m in made if m.even_step is not None]
    assert 0 < len(steps) < 40
    assert max(steps) > 1.3 > 0.8 > min(steps)
    assert set().union(*(m.left_out for m in made)) == set(OPTIONAL)
    waists = [m.device.sheet.waist_mm for m in made]
    assert max(waists) > 2 * min(waists)
    for m in made:
        stated = {e["name"]: e for e in m.nominal_edges()}
        assert stated["finite_spot"]["line_sd_um"] == pytest.approx(
            1e3 * m.device.sheet.waist_mm, abs=0.01
        )
