"""Spacing of flaws: the distance between footprints, with and without boxes in between."""

import numpy as np
import pytest
from manifold3d import Manifold
from scipy.spatial.distance import cdist

from defects.carving.booleans import solid_of
from defects.carving.solid import Cutter
from pipeline.injection.spacing import Footprint

WANTED_MM = 2.0


def cube_at(x, y, z):
    """Return the footprint of a cube of 4 mm around a place."""
    solid = solid_of(Manifold.cube((4.0, 4.0, 4.0), True).translate((x, y, z)))
    none = np.zeros((0, 3))
    cutter = Cutter(
        removed=solid, added=None, skin_mm=none, normals=none, height_mm=np.zeros(0), above_mm=none
    )
    return Footprint(cutter, WANTED_MM)


@pytest.mark.parametrize("step", np.linspace(4.2, 8.0, 12))
@pytest.mark.parametrize("way", [(1.0, 0.0, 0.0), (0.6, 0.8, 0.0), (0.48, 0.6, 0.64)])
def test_near_is_what_the_points_tell(step, way):
    place = np.array([1.0, 2.0, 3.0]) + step * np.array(way)
    one, other = cube_at(1.0, 2.0, 3.0), cube_at(*place)
    gap = max(WANTED_MM, one.spacing_mm)
    near = bool(cdist(one.points_mm, other.points_mm).min() < gap)
    assert one.is_near(other) == other.is_near(one) == near
    assert one.is_near_point(place) == bool(cdist(one.points_mm, place[None]).min() < gap)


def test_points_are_drawn_only_where_something_is_near():
    one, other = cube_at(0.0, 0.0, 0.0), cube_at(20.0, 0.0, 0.0)
    assert not one.is_near(other)
    assert not one.is_near_point(np.array([0.0, 9.0, 0.0]))
    assert "points_mm" not in vars(one)
