"""The camera of the pictures: projection, shading and splatting against known geometry."""

import numpy as np
import pytest
import trimesh

from pipeline.preview.camera import Camera, light, render, smooth_normals, splat
from sensors.casting.scene import Scene

WHITE = np.ones(3)


def scene_of(mesh: trimesh.Trimesh) -> Scene:
    return Scene(mesh.vertices, mesh.faces)


@pytest.fixture(scope="module")
def ball() -> Scene:
    return scene_of(trimesh.creation.icosphere(subdivisions=4, radius=10.0))


def camera_on(points, pixels=(240, 160), **more) -> Camera:
    look, up = np.array([0.3, 0.5, -0.8]), np.array([0.0, 0.0, 1.0])
    return Camera.around(np.asarray(points, float), look=look, up=up, pixels=pixels, **more)


def test_everything_asked_for_is_in_the_picture_and_pixels_are_square() -> None:
    rng = np.random.default_rng(1)
    points = rng.normal(size=(200, 3)) * [100, 10, 30] + [5, 6, 7]
    camera = camera_on(points, margin=0.05, foot=0.1)
    left, right, bottom, top = camera.extent_mm
    flat = camera.plane_mm(points)
    assert (flat > [left, bottom]).all()
    assert (flat < [right, top]).all()
    assert (right - left) / 240 == pytest.approx((top - bottom) / 160)
    assert flat[:, 1].min() - bottom > 0.1 * (top - bottom), "the foot stays free"


def test_the_image_plane_is_true_to_scale() -> None:
    camera = camera_on(np.eye(3))
    np.testing.assert_allclose(camera.frame @ camera.frame.T, np.eye(3), atol=1e-15)
    across = camera.frame[0] * 3 + camera.frame[1] * 4 + camera.frame[2] * 1000
    shift = camera.plane_mm(across) - camera.plane_mm(np.zeros(3))
    assert np.linalg.norm(shift) == pytest.approx(5)


def test_a_ball_covers_its_disc(ball: Scene) -> None:
    camera = camera_on(ball.vertices_mm)
    picture = render(ball, camera, np.tile(WHITE, (len(ball.faces), 1)))
    left, right, bottom, top = camera.extent_mm
    pixel_mm2 = (right - left) / 240 * (top - bottom) / 160
    assert (picture[..., 3] > 0.99).sum() * pixel_mm2 == pytest.approx(np.pi * 100, rel=0.02)
    rows, columns = np.nonzero(picture[..., 3] > 0.99)
    assert rows.mean() == pytest.approx(79.5, abs=0.6)
    assert columns.mean() == pytest.approx(119.5, abs=0.6)


def test_smoothed_normals_of_a_ball_point_away_from_its_centre(ball: Scene) -> None:
    rng = np.random.default_rng(2)
    triangle = rng.integers(0, len(ball.faces), 500).astype(np.int32)
    weight = rng.dirichlet(np.ones(3), 500)
    points = (ball.vertices_mm[ball.faces[triangle]] * weight[..., None]).sum(axis=1)
    smooth = smooth_normals(ball, points, triangle)
    radial = points / np.linalg.norm(points, axis=1, keepdims=True)
    error = np.degrees(np.arccos(np.clip((smooth * radial).sum(axis=1), -1, 1)))
    flat = np.degrees(np.arccos(np.clip((ball.normals[triangle] * radial).sum(axis=1), -1, 1)))
    assert error.max() < 0.4
    assert error.mean() < flat.mean() / 5


def test_a_box_keeps_its_edges_and_groups_are_kept_apart(ball: Scene) -> None:
    box = scene_of(trimesh.creation.box((2, 3, 4)))
    triangle = np.arange(len(box.faces), dtype=np.int32)
    centres = box.vertices_mm[box.faces].mean(axis=1)
    np.testing.assert_allclose(smooth_normals(box, centres, triangle), box.normals, atol=1e-12)
    triangle = np.arange(len(ball.faces), dtype=np.int32)
    corner = ball.vertices_mm[ball.faces[:, 0]]
    alone = smooth_normals(ball, corner, triangle, groups=triangle)
    np.testing.assert_allclose(alone, ball.normals, atol=1e-12)


def test_light_falls_off_with_the_angle_and_is_never_negative() -> None:
    normals = np.array([[-0.80, 0.42, 0.42], [0.0, 0.0, 1.0], [0.6, -0.8, 0.0], [0.0, 0.0, -1.0]])
    shade = light(normals / np.linalg.norm(normals, axis=1, keepdims=True))
    assert shade[0] > shade[1] > shade[2] >= shade[3] > 0


def test_stretched_relief_shows_what_is_too_shallow_otherwise() -> None:
    x, y = np.meshgrid(np.linspace(-1, 1, 41), np.linspace(-1, 1, 41))
    top = np.stack([x, y, 0.004 * np.cos(6 * x)], axis=-1).reshape(-1, 3)
    cell = np.arange(40 * 41).reshape(40, 41)[:, :40].ravel()
    faces = np.concatenate([np.stack([cell, cell + 1, cell + 42], axis=1),
                            np.stack([cell, cell + 42, cell + 41], axis=1)])  # fmt: skip
    scene = Scene(top, faces)
    camera = camera_on(top, pixels=(90, 90))
    grey = np.tile(WHITE * 0.7, (len(faces), 1))
    plain, stretched = (render(scene, camera, grey, relief=on)[30:60, 30:60, 0] for on in (0, 1))
    assert np.ptp(stretched) > 4 * np.ptp(plain)


def test_the_nearest_point_of_a_cloud_is_on_top() -> None:
    camera = camera_on([[-1, -1, -1], [1, 1, 1]], pixels=(21, 21))
    back = camera.frame[2]
    points = np.array([0.5 * back, -0.5 * back, 0.2 * back])
    for order in ([0, 1, 2], [2, 1, 0], [1, 0, 2]):
        picture = splat(points[order], np.eye(3)[order], camera, radius_px=2)
        assert picture[..., 3].sum() == 9, "three pixels each way"
        assert (picture[picture[..., 3] > 0][:, :3] == [1, 0, 0]).all()
