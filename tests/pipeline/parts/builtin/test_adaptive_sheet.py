"""How far a cell's triangles lie from the sheet, against plain numpy and closed forms."""

import numpy as np
import pytest

from pipeline.parts.builtin.adaptive_sheet import close_sheet
from pipeline.parts.builtin.cell_error import all_rise, measure

SAMPLES = 5


def cells_on(height, size, count=6):
    """Points (C, S, S, 3) of square cells on a surface z = height(x, y), side by side."""
    share = np.linspace(0.0, 1.0, SAMPLES)
    low = (np.arange(count) - count / 2) * size
    x = (low[:, None, None, None] + size * share[:, None]) + np.zeros((1, count, 1, SAMPLES))
    y = (low[None, :, None, None] + size * share) + np.zeros((count, 1, SAMPLES, 1))
    return np.stack([x, y, height(x, y)], axis=-1).reshape(-1, SAMPLES, SAMPLES, 3)


def measured(cloud):
    error, bend, length = np.zeros(len(cloud)), np.zeros((2, len(cloud))), np.empty((2, len(cloud)))
    measure(cloud, error, bend, length)
    return error, bend, length


def test_a_plane_has_no_error():
    error, bend, length = measured(cells_on(lambda x, y: 0.3 * x - 0.2 * y + 5.0, 2.0))
    np.testing.assert_allclose(error, 0.0, atol=1e-14)
    np.testing.assert_allclose(bend, 0.0, atol=1e-14)
    np.testing.assert_allclose(length[0], 2.0 * np.hypot(1.0, 0.3))
    np.testing.assert_allclose(length[1], 2.0 * np.hypot(1.0, 0.2))


def test_a_cylinder_bends_across_its_axis():
    radius, size = 50.0, 2.0
    error, bend, length = measured(cells_on(lambda x, y: np.sqrt(radius**2 - x**2), size))
    sagitta = size**2 / (8.0 * radius)
    # cells off the crest are cut shorter by the tilt of the surface
    assert error.max() == pytest.approx(sagitta, rel=0.02)
    np.testing.assert_allclose(bend[0], error, rtol=1e-3)
    np.testing.assert_allclose(bend[1], 0.0, atol=1e-14)
    assert (length[0] >= length[1]).all()


def test_each_face_of_a_cell_counts():
    flat = cells_on(lambda x, y: 0.0 * x, 2.0)
    bent = cells_on(lambda x, y: 0.01 * x**2, 2.0)
    error, bend, length = measured(bent)
    both = error.copy(), bend.copy(), length.copy()
    measure(flat, *both)
    np.testing.assert_array_equal(both[0], error)
    np.testing.assert_array_equal(both[1], bend)
    np.testing.assert_allclose(both[2], 2.0)


def test_a_cell_that_is_a_point_has_no_error():
    error, bend, length = measured(np.ones((3, SAMPLES, SAMPLES, 3)))
    assert not error.any()
    assert not bend.any()
    assert not length.any()


def test_the_shorter_diagonal_of_a_leaning_cell():
    p00, p10, p01, p11 = np.array([[[0, 0, 0]], [[1, 0, 0]], [[0.8, 1, 0]], [[1.8, 1, 0]]], float)
    assert not all_rise(p00, p10, p01, p11)[0]  # from p10 to p01
    assert all_rise(p10, p00, p11, p01)[0]


def test_facets_of_a_sphere_keep_their_distance():
    def sheet(a, b):
        x, y = 30.0 * a, 30.0 * b
        outward = np.stack([x, y, np.sqrt(100.0**2 - x**2 - y**2)], axis=1)
        return outward, 0.98 * outward

    vertices, faces, side, _ = close_sheet(sheet, facet_mm=0.02, start=8)
    middle = vertices[faces[side == 0]].mean(axis=1)
    off = 100.0 - np.linalg.norm(middle, axis=1)
    assert off.max() <= 0.02 * 1.05
    assert off.max() > 0.005
