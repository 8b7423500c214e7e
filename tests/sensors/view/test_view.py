"""Geometry of a view against closed forms."""

import math
import pickle
import weakref

import numpy as np
import pytest

from files.errors import RecipeError
from sensors.surface.reflectance import ReflectanceMap, Stripes
from sensors.view.covariates import COVARIATES
from sensors.view.edges import edge_height_mm, edge_offset_mm
from sensors.view.view import Reason, View


@pytest.mark.parametrize("columns", ["even_x", "even_angle"])
@pytest.mark.parametrize("turned", [False, True])
def test_slopes_and_angles_of_a_tilted_plate(view_of, columns, turned):
    tilts = {"tilt_y_deg": 20.0, "tilt_x_deg": -10.0}
    view = view_of("plate", solid=tilts, sheet={"columns": columns}, turned=turned)
    dx = (view.depth_mm[:, 1:] - view.depth_mm[:, :-1]) / np.diff(view.x_mm, axis=1)
    dy = (view.depth_mm[1:] - view.depth_mm[:-1]) / np.diff(view.travel_mm)[:, None]
    if columns == "even_x":  # only there do neighbours in y share their x
        assert np.allclose(view.slope_y[1:], dy, atol=1e-6)
        assert np.allclose(view.slope_x[:, 1:], dx, atol=1e-6)
    normal = view.normal[0, 0]
    assert np.isclose(np.linalg.norm(normal), 1.0)
    assert normal[2] < 0  # outward: towards the sensor
    cosine = -(view.ray @ normal)
    assert np.allclose(np.cos(view.incidence_rad), cosine[None, :])
    assert np.allclose(view.slope_y, -normal[1] / normal[2])


def test_points_in_the_part_frame_lie_on_the_part(view_of):
    view = view_of("plate", sheet={"columns": "even_angle"})
    assert np.allclose(view.part_mm[..., 2], 0.0, atol=1e-9)
    assert np.allclose(view.part_mm[..., 1], view.poses[:, 1, 3][:, None], atol=1e-9)
    assert np.allclose(view.part_mm[..., 0], -view.x_mm, atol=1e-9)


def test_half_vector_of_a_flat_plate(view_of):
    """Laser from above, camera at 30°: the half vector is 15° off the normal, in between."""
    view = view_of("plate")
    middle = view.half_vector_rad[0, 39:41].mean()
    assert np.isclose(middle, math.radians(15.0), atol=1e-4)
    assert np.isclose(view.cos_camera[0, 39:41].mean(), math.cos(math.radians(30.0)), atol=1e-4)


@pytest.mark.parametrize("columns", ["even_x", "even_angle"])
def test_half_vector_is_the_sum_of_unit_vectors_to_laser_and_camera(view_of, columns):
    tilts = {"tilt_y_deg": 20.0, "tilt_x_deg": -10.0}
    view = view_of("plate", solid=tilts, sheet={"columns": columns}, turned=True)
    way = view.camera_mm - view.sensor_mm
    half = way / np.linalg.norm(way, axis=-1, keepdims=True) - view.ray
    half /= np.linalg.norm(half, axis=-1, keepdims=True)
    expected = np.arccos((view.normal * half).sum(axis=-1))
    assert view.half_vector_rad == pytest.approx(expected, abs=1e-9)


def test_reasons_of_missing_points(view_of):
    off_the_end = view_of("end", y_mm=[0.0, 15.0])
    assert (off_the_end.reason == [[Reason.VALID], [Reason.NO_HIT]]).all()
    too_far = view_of("plate", height_mm=260.0)
    assert (too_far.reason == Reason.OUT_OF_RANGE).all()
    assert np.isnan(too_far.depth_mm).all()
    assert np.isfinite(too_far.hits.depth_mm).all()


def test_range_limits_are_valid(view_of):
    for height in (150.0, 250.0):
        assert view_of("plate", height_mm=height).in_range.all()


def test_travel_is_signed_by_the_sensors_y(view_of):
    y = np.array([0.0, 1.0, 3.0, 2.0])
    assert np.allclose(view_of("plate", y_mm=y).travel_mm, [0, 1, 3, 2])
    assert np.allclose(view_of("plate", y_mm=y, turned=True).travel_mm, [0, -1, -3, -2])
    assert np.allclose(view_of("plate", y_mm=y).travel_step_mm, [1, 2, -1, -1])
    assert np.array_equal(view_of("plate", y_mm=[5.0]).travel_step_mm, [0.0])


def test_shifted_views_are_scans_from_elsewhere(view_of):
    view = view_of("plate", solid={"tilt_y_deg": 30.0, "tilt_x_deg": 10.0})
    for shift, slope in (({"dy_mm": 0.5}, view.slope_y), ({"dx_mm": 0.5}, view.slope_x)):
        change = view.shifted(**shift).depth_mm - view.depth_mm
        assert np.allclose(change, 0.5 * slope, atol=1e-9)
    assert np.allclose(view.shifted(dz_mm=2.0).depth_mm, view.depth_mm - 2.0)
    assert view.shifted() is view
    assert view.shifted(dy_mm=0.5) is view.shifted(dy_mm=0.5)
    each = np.linspace(-1, 1, 60)
    change = view.shifted(dy_mm=each).depth_mm - view.depth_mm
    assert np.allclose(change, each[:, None] * view.slope_y, atol=1e-9)


def test_rows_are_a_part_of_the_scan(view_of):
    view = view_of("step", intensity=np.random.default_rng(0).random((60, 80)))
    part = view.rows(slice(10, 20))
    assert np.array_equal(part.depth_mm, view.depth_mm[10:20], equal_nan=True)
    assert np.array_equal(part.brightness, view.brightness[10:20])
    assert np.array_equal(part.visible, view.visible[10:20])


def test_visible_agrees_with_single_sight_lines(view_of):
    for name in ("step", "groove", "cylinder", "bench"):
        view = view_of(name, sheet={"columns": "even_angle"}, y_mm=np.linspace(-27, 27, 60))
        rows, columns = np.nonzero(view.in_range)
        points = view.part_mm[rows, columns]
        cameras = view.poses[rows, :3, 1] * view.camera_mm[1] + view.poses[rows, :3, 3]
        triangle = view.triangle[rows, columns]
        facing = np.einsum("ik,ik->i", view.scene.normals[triangle], cameras - points) > 0
        free = facing & ~view.scene.blocked(points, cameras, triangle)
        assert np.mean(view.visible[rows, columns] != free) < 2e-3  # edges seen end on
        assert not view.visible[~view.in_range].any()


def test_edges_along_the_travel(view_of):
    places = np.linspace(-25.2, 24.8, 101)  # edges at ±10 lie between profiles
    view = view_of("step", y_mm=places)
    y = view.poses[:, 1, 3]
    offset = edge_offset_mm(view)[:, 40]
    height = edge_height_mm(view)[:, 40]
    nearest = np.where(y < 0, -10.0, 10.0)
    assert np.allclose(offset, nearest - y, atol=0.26)
    assert np.allclose(height, np.where(np.abs(y) < 10, 10.0, -10.0))
    turned = view_of("step", y_mm=places, turned=True)
    assert np.allclose(edge_offset_mm(turned)[:, 40], -offset)
    assert np.allclose(edge_height_mm(turned)[:, 40], height)
    back = view_of("step", y_mm=places[::-1])
    assert np.allclose(edge_offset_mm(back)[::-1, 40], offset)
    assert np.isinf(edge_height_mm(view_of("end"))).any()


def test_every_covariate_has_the_scans_shape(view_of):
    bright = ReflectanceMap(base=0.8, stripes=(Stripes(value=0.2, period_mm=7.0),))
    view = view_of("bench", reflectance=bright, y_mm=np.linspace(-24.7, 24.6, 60))
    for name, covariate in COVARIATES.items():
        values = np.broadcast_to(covariate.values(view), view.shape)
        known = np.isfinite(values) if name != "edge_height" else ~np.isnan(values)
        assert known[view.in_range].any(), name
        assert covariate.words
        assert covariate.name == name


def test_covariates_of_known_shapes(view_of):
    y = np.linspace(-10, 10, 81)
    round_part = view_of("cylinder", y_mm=y)
    curvature = COVARIATES["curvature_y"].values(round_part)[40, 40]
    assert np.isclose(curvature, 1 / 30.0, rtol=1e-2)
    intensity = np.repeat(np.exp(0.2 * y)[:, None], 80, axis=1) / 10
    view = view_of("plate", y_mm=y, intensity=intensity)
    assert np.allclose(COVARIATES["brightness_slope"].values(view), 0.2)
    clock = COVARIATES["clock"].values(view_of("plate", start_time_s=50.0))
    assert np.allclose(clock[:, 0], 50.0 + np.arange(60) / 100)


def test_camera_needs_its_angle(view_of):
    view = view_of("plate", sheet={"triangulation_angle_deg": None})
    with pytest.raises(RecipeError, match="triangulation_angle_deg"):
        _ = view.visible
    assert np.isnan(view.mirror.landed_mm).all()  # and without it nobody sees a second spot


def test_view_travels_without_what_it_computed(view_of):
    view = view_of("step")
    _ = view.normal, view.visible
    copy = pickle.loads(pickle.dumps(view))
    assert "normal" not in copy.__dict__
    assert np.array_equal(copy.depth_mm, view.depth_mm, equal_nan=True)


def test_poses_and_times_must_fit(view_of):
    view = view_of("plate")
    with pytest.raises(ValueError, match="poses"):
        View(view.scene, view.sensor, np.eye(4), [0.0])
    with pytest.raises(ValueError, match="time_s"):
        View(view.scene, view.sensor, view.poses, [0.0])


def test_views_that_are_cast_together_are_those_cast_one_by_one(view_of):
    moves = [-0.8, 0.0, 0.3, np.linspace(-0.5, 0.5, len(view_of("step").poses))]
    together, camera_mm = view_of("step"), view_of("step").datasheet.camera_offset_mm
    for axis in ("x", "y"):
        found = list(together.shifted_each(moves, axis=axis, camera_y_mm=camera_mm))
        for move, one in zip(moves, found, strict=True):
            alone = view_of("step").shifted(**{f"d{axis}_mm": move})
            assert one is together.shifted(**{f"d{axis}_mm": move})
            assert one.is_cast
            np.testing.assert_array_equal(one.depth_mm, alone.depth_mm)
            np.testing.assert_array_equal(one.triangle, alone.triangle)
            np.testing.assert_array_equal(
                one.visible_from(camera_mm), alone.visible_from(camera_mm)
            )
        assert not found[0].visible.all()


def test_of_views_with_many_points_one_is_held_at_a_time(view_of, monkeypatch):
    monkeypatch.setattr("sensors.view.view.TOGETHER", 0)
    monkeypatch.setattr("sensors.view.view.KEPT_POINTS", 0)
    view, held = view_of("step"), []
    for one in view.shifted_each([-0.4, 0.2, 0.6], axis="y"):
        held = [*(v for v in held if v() is not None), weakref.ref(one)]
        assert len(held) == 1 or held[-2]() is None
