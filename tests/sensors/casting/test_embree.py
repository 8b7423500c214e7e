"""Single rays: Embree finds, double precision decides."""

import numpy as np
import pytest
import trimesh

from sensors.casting import embree
from sensors.casting.scene import Scene
from tests.support.solids import rotation, scene_of, solids

SOLIDS = dict(solids(np.random.default_rng(11)))


def by_hand(scene, origins, directions):
    """First hits by Möller and Trumbore's formula on every triangle, in double precision."""
    a, b, c = (scene.vertices_mm[scene.faces[:, i]] for i in range(3))
    u, v = b - a, c - a
    distance = np.full(len(origins), np.nan)
    for r, (o, d) in enumerate(zip(origins, directions, strict=True)):
        d = d / np.linalg.norm(d)
        p = np.cross(d, v)
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = 1 / np.einsum("ij,ij->i", u, p)
            s = np.einsum("ij,ij->i", o - a, p) * inverse
            q = np.cross(o - a, u)
            t = q @ d * inverse
            way = np.einsum("ij,ij->i", v, q) * inverse
            met = (s >= 0) & (t >= 0) & (s + t <= 1) & (way > 0)
        if met.any():
            distance[r] = way[met].min()
    return distance


@pytest.mark.parametrize("name", SOLIDS)
def test_first_hits_are_those_of_every_triangle_tried(name):
    rng = np.random.default_rng(5)
    scene = scene_of(SOLIDS[name])
    origins = rng.normal(size=(300, 3))
    origins *= 120 / np.linalg.norm(origins, axis=1, keepdims=True)
    towards = rng.uniform(-1, 1, (300, 3)) * np.abs(scene.vertices_mm).max(axis=0)
    distance, triangle = scene.first_hit(origins, towards - origins)
    expected = by_hand(scene, origins, towards - origins)
    np.testing.assert_array_equal(triangle >= 0, np.isfinite(expected))
    np.testing.assert_array_equal(np.isfinite(distance), np.isfinite(expected))
    np.testing.assert_allclose(distance, expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("away_mm", [0.0, 1e4])
def test_no_ray_is_lost_at_vertices_and_edges(away_mm):
    # Rough along its radii only, so that every ray to the centre goes in where it meets it.
    rough = trimesh.creation.icosphere(3, 25)
    rough.vertices *= np.random.default_rng(9).uniform(0.9, 1.1, (len(rough.vertices), 1))
    rough.vertices += away_mm
    scene = scene_of(rough)
    inside = np.full(3, away_mm)
    corners = scene.vertices_mm
    middles = scene.vertices_mm[rough.edges_unique].mean(axis=1)
    for targets in (corners, middles):
        out = targets - inside
        origins = inside + out * (100 / np.linalg.norm(out, axis=1, keepdims=True))
        distance, triangle = scene.first_hit(origins, -out)
        assert (triangle >= 0).all()
        reach = 100 - np.linalg.norm(out, axis=1)
        np.testing.assert_allclose(distance, reach, rtol=0, atol=1e-9)


def test_rays_may_start_anywhere_and_have_any_length():
    box = scene_of(trimesh.creation.box((20, 20, 20)))
    origins = np.array([[0, 0, 0], [0, 0, -1e5], [0.5, 0.5, 0], [30.0, 0, 0]])
    directions = np.array([[0, 0, 1e-3], [0, 0, 1], [100, 0, 0], [1, 0, 0]])
    distance, triangle = box.first_hit(origins, directions)
    np.testing.assert_allclose(distance[:3], [10, 1e5 - 10, 9.5], atol=1e-9)
    assert triangle[3] == -1


@pytest.mark.parametrize("name", ["torus", "pockets"])
def test_a_hit_from_inside_is_the_wall_thickness(name):
    scene = scene_of(SOLIDS[name])
    rng = np.random.default_rng(2)
    mesh = SOLIDS[name]
    points, triangle = trimesh.sample.sample_surface(mesh, 200, seed=rng)
    start = points - 1e-3 * scene.normals[triangle]
    distance, _ = scene.first_hit(start, -scene.normals[triangle])
    np.testing.assert_allclose(
        distance, by_hand(scene, start, -scene.normals[triangle]), rtol=0, atol=1e-9
    )


def test_a_convex_solid_hides_what_faces_away():
    hull = SOLIDS["hull"]
    scene = scene_of(hull)
    points = hull.triangles_center
    eye = np.array([10.0, 20.0, -300.0])
    facing = np.einsum("ij,ij->i", scene.normals, eye - points) > 0
    own = np.arange(len(points), dtype=np.int32)
    assert facing.any()
    # Seen from outside the solid, a ray from a face that looks away runs through the solid.
    for triangle in (own, None):
        np.testing.assert_array_equal(scene.blocked(points, eye, triangle), ~facing)


def test_what_lies_behind_the_other_end_blocks_nothing():
    box = scene_of(trimesh.creation.box((20, 20, 20)))
    start = np.array([[0, 0, -50.0], [0, 0, -50.0], [0, 0, -50.0], [0, 0, -10.0]])
    end = np.array([[0, 0, -11.0], [0, 0, -9.0], [0, 0, 50.0], [0, 0, -60.0]])
    np.testing.assert_array_equal(box.blocked(start, end), [False, True, True, False])


def test_a_slit_of_ten_micrometres_lets_a_sight_line_through():
    slit = trimesh.boolean.difference(
        [trimesh.creation.box((300, 300, 20)), trimesh.creation.box((0.01, 200, 60))]
    )
    turned = rotation(np.random.default_rng(4))
    scene = Scene(slit.vertices @ turned.T, slit.faces)
    x = np.array([-0.0051, -0.0049, 0.0, 0.0049, 0.0051])
    start = np.stack([x, 0 * x, 0 * x - 80], axis=-1)
    end = start + [0, 0, 160]
    np.testing.assert_array_equal(
        scene.blocked(start @ turned.T, end @ turned.T), [True, False, False, False, True]
    )


def test_the_last_resort_agrees_with_the_search(monkeypatch):
    scene = scene_of(SOLIDS["rough sphere"])
    rng = np.random.default_rng(8)
    origins = rng.normal(size=(100, 3))
    origins *= 90 / np.linalg.norm(origins, axis=1, keepdims=True)
    directions = rng.normal(size=(100, 3)) * 10 - origins
    searched, triangle = scene.first_hit(origins, directions)
    monkeypatch.setattr(embree, "ROUNDS", 0)  # no candidate is looked at: each triangle is tried
    tried, same = scene.first_hit(origins, directions)
    assert (triangle >= 0).any()
    np.testing.assert_array_equal(triangle, same)
    np.testing.assert_array_equal(searched, tried)
