"""Fewer triangles for a grid: without gaps, within the tolerance, and few where it is flat."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from defects.carving.stitch import is_closed
from defects.shape.patch import Patch
from defects.shape.thinning import BLOCKS, Grid, filled

HILL_MM = 0.4


def strip(rows, columns, height):
    """A patch over a flat rectangle of 10 mm x 6 mm, and heights over it."""
    x, y = np.meshgrid(np.linspace(0, 10, rows), np.linspace(0, 6, columns), indexing="ij")
    node = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    grid = Grid(node=node)
    skin = np.stack([x, y, np.zeros_like(x)], axis=2).reshape(-1, 3)
    patch = Patch(
        skin_mm=skin, normals=np.tile([0.0, 0.0, 1.0], (len(skin), 1)), faces=grid.faces,
        first=x.ravel(), second=y.ravel(), grid=grid,
    )  # fmt: skip
    return patch, height(x, y).ravel()


def disk(sectors, rings, height):
    """A patch over a flat disk of 5 mm, and heights over it."""
    angle, rho = np.meshgrid(
        np.arange(sectors) * 2 * np.pi / sectors, np.arange(1, rings + 1) / rings, indexing="ij"
    )
    x = np.concatenate([[0.0], (5 * rho * np.cos(angle)).ravel()])
    y = np.concatenate([[0.0], (5 * rho * np.sin(angle)).ravel()])
    node = 1 + np.arange(sectors * rings, dtype=np.int32).reshape(sectors, rings)
    grid = Grid(node=node, hub=0)
    skin = np.stack([x, y, np.zeros_like(x)], axis=1)
    patch = Patch(
        skin_mm=skin, normals=np.tile([0.0, 0.0, 1.0], (len(skin), 1)), faces=grid.faces,
        first=x, second=y, grid=grid,
    )  # fmt: skip
    return patch, height(x, y)


def hill(x, y):
    return HILL_MM * np.exp(-((x - 3) ** 2 + (y - 2) ** 2) / 2)


def heights_of(faces, places, xy):
    """Heights of a mesh, that is a function of x and y, above some places."""
    mesh = trimesh.Trimesh(places, faces, process=False)
    origins = np.column_stack([xy, np.full(len(xy), 10.0)])
    down = np.tile([0.0, 0.0, -1.0], (len(xy), 1))
    found, ray, _ = mesh.ray.intersects_location(origins, down, multiple_hits=False)
    z = np.full(len(xy), np.nan)
    z[ray] = found[:, 2]
    return z


@pytest.mark.parametrize("make", [strip, disk])
@pytest.mark.parametrize("tolerance_mm", [0.02, 0.002])
def test_all_points_lie_within_the_tolerance(make, tolerance_mm):
    patch, height = make(65 if make is strip else 64, 33, hill)
    places = patch.skin_mm + height[:, None] * patch.normals
    faces = patch.grid.thinned(places, tolerance_mm)
    assert len(faces) < 0.5 * len(patch.faces)
    inside = np.abs(patch.skin_mm[:, :2] - [5, 3] if make is strip else patch.skin_mm[:, :2])
    inside = (inside < [4.9, 2.9]).all(axis=1) if make is strip else inside.max(axis=1) < 3
    off = heights_of(faces, places, places[inside, :2]) - places[inside, 2]
    assert np.abs(off).max() <= 4 / 3 * tolerance_mm
    assert np.abs(off).max() > 0.1 * tolerance_mm


@given(
    rows=st.integers(2, 20), columns=st.integers(2, 20), ring=st.booleans(),
    tolerance_mm=st.floats(1e-3, 1), seed=st.integers(0, 2**32 - 1), block=st.sampled_from(BLOCKS),
)  # fmt: skip
@settings(max_examples=80, deadline=None)
def test_solids_are_closed_whatever_is_left_out(rows, columns, ring, tolerance_mm, seed, block):
    rng = np.random.default_rng(seed)
    rows, columns = rows // 8 * block + block, columns // 8 * block + block + 1
    make = disk if ring else strip
    patch, _ = make(max(rows, 4) if ring else rows + 1, columns, hill)
    low = -1 - rng.uniform(0, 1, len(patch.skin_mm)) ** 8
    high = rng.uniform(0, 1, len(patch.skin_mm)) ** 8
    solid = patch.solid(low, high, loose_mm=(tolerance_mm, tolerance_mm))
    full = patch.solid(low, high)
    assert is_closed(solid.faces)
    assert is_closed(full.faces)
    assert solid.volume_mm3 > 0
    assert len(solid.faces) <= len(full.faces)
    assert len(np.unique(solid.faces)) == len(solid.vertices_mm)


def test_a_flat_side_takes_two_triangles_a_block():
    patch, height = strip(65, 33, lambda x, y: 0 * x)
    places = patch.skin_mm + height[:, None] * patch.normals
    assert len(patch.grid.thinned(places, 1e-6)) == 2 * 4 * 2


def test_faces_keep_their_side():
    for patch, height in (strip(17, 17, hill), disk(16, 17, hill)):
        places = patch.skin_mm + height[:, None] * patch.normals
        for faces in (patch.faces, patch.grid.thinned(places, 0.05)):
            a, b, c = (places[faces[:, k]] for k in range(3))
            assert (np.cross(b - a, c - a)[:, 2] > 0).all()


def test_positions_come_between_where_gaps_are_widest():
    found = filled(np.concatenate([np.arange(1, 7) / 10, np.arange(16, 25) / 10]))
    assert len(found) == 16
    assert found[6] == pytest.approx(1.1)
    few = np.array([1.0, 2.0, 3.0])
    np.testing.assert_array_equal(filled(few, 1), few)  # 3 = 2 + 1 already
