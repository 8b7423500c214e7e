"""Cells of a projection: each lists all faces over any of its places."""

import numpy as np
import pytest

from defects.carving.bounding_box import bounding_box, row_boxes
from defects.carving.point_in_mesh import face_bins


@pytest.mark.parametrize("size", [0.1, 1.0, 20.0])
@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e3])
def test_each_cell_lists_the_faces_over_its_places(size, scale):
    rng = np.random.default_rng(3)
    corners = rng.uniform(0, 10, (60, 1, 3)) + size * rng.normal(size=(60, 3, 3))
    plane = scale * (50 + corners.reshape(-1, 3))
    faces = np.arange(len(plane), dtype=np.int32).reshape(-1, 3)
    low, high = bounding_box(plane)
    cell = float((high - low)[:2].max()) / 25
    nx, ny = (int(n) for n in np.floor((high - low)[:2] / cell) + 1)
    start, members = face_bins(plane, faces, low, cell, nx, ny)
    # places on the faces, corners and sides among them
    share = rng.dirichlet((0.3, 0.3, 0.3), (len(faces), 50))
    share[:, :3] = np.eye(3)
    share[:, 3] = (0.5, 0.5, 0.0)
    places = np.einsum("fpc,fcx->fpx", share, plane[faces])
    at = np.minimum(((places[..., :2] - low[:2]) / cell).astype(int), (nx - 1, ny - 1))
    number = at[..., 0] * ny + at[..., 1]
    for face in range(len(faces)):
        for one in number[face]:
            assert face in members[start[one] : start[one + 1]]
    boxes = ((row_boxes(plane[faces])[1] - row_boxes(plane[faces])[0])[:, :2] / cell + 2).prod(1)
    assert len(members) < boxes.sum()


def test_boxes_are_those_of_all_columns():
    points = np.random.default_rng(1).normal(size=(30, 3))
    np.testing.assert_array_equal(bounding_box(points), [points.min(axis=0), points.max(axis=0)])
    least, most = row_boxes(points.reshape(-1, 3, 3))
    np.testing.assert_array_equal(least, points.reshape(-1, 3, 3).min(axis=1))
    np.testing.assert_array_equal(most, points.reshape(-1, 3, 3).max(axis=1))
