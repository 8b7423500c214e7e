"""The surface: nearest points against brute force, normals and walks against closed forms."""

import numpy as np
import pytest
import trimesh

from defects.surface.surface import Site, SiteError, Surface, tangent_axes


def test_nearest_point_equals_brute_force():
    mesh = trimesh.creation.annulus(r_min=3.0, r_max=7.0, height=4.0, sections=40)
    surface = Surface.of(mesh.vertices, mesh.faces)
    points = np.random.default_rng(3).uniform(-9, 9, (400, 3))
    onto, _, triangles = surface.project(points)
    expected, distance, _ = trimesh.proximity.closest_point_naive(mesh, points)
    np.testing.assert_allclose(np.linalg.norm(points - onto, axis=1), distance, atol=1e-10)
    np.testing.assert_allclose(onto, expected, atol=1e-7)
    corners = mesh.triangles[triangles]
    bary = trimesh.triangles.points_to_barycentric(corners, onto)
    assert bary.min() > -1e-9


def test_normals_are_radial_on_a_sphere_and_exact_on_a_plate(surfaces):
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(200, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    _, normals, _ = surfaces["sphere"].project(30 * directions)
    # The facets' own normals are up to half the angle between them off, here about 1 degree.
    assert np.degrees(np.arccos(np.sum(normals * directions, axis=1))).max() < 0.4
    points = np.column_stack([rng.uniform(-39, 39, 200), rng.uniform(-29, 29, 200), np.ones(200)])
    onto, normals, _ = surfaces["plate"].project(points)
    np.testing.assert_array_equal(normals, np.tile([0.0, 0.0, 1.0], (200, 1)))
    np.testing.assert_allclose(onto[:, :2], points[:, :2], atol=1e-13)


def test_places_are_uniform_by_area_and_follow_the_mask(surfaces):
    surface = surfaces["plate"]
    sites = surface.random_sites(np.random.default_rng(5), 6000)
    share = np.bincount([site.triangle for site in sites], minlength=len(surface.faces)) / 6000
    expected = surface.area_mm2 / surface.area_mm2.sum()
    assert np.abs(share - expected).max() < 4 * np.sqrt(0.25 / 6000)
    top = surface.normals[:, 2] > 0.5
    sites = surface.random_sites(np.random.default_rng(5), 4000, top.astype(float))
    xy = np.stack([site.position_mm for site in sites])
    assert (xy[:, 2] == 0).all()
    # Mean and variance of an even density over 80 x 60 mm.
    np.testing.assert_allclose(xy[:, :2].mean(axis=0), 0.0, atol=4 * 80 / np.sqrt(12 * 4000))
    np.testing.assert_allclose(xy[:, :2].var(axis=0), [80**2 / 12, 60**2 / 12], rtol=0.08)
    with pytest.raises(SiteError, match="no face"):
        surface.random_sites(np.random.default_rng(5), 1, np.zeros(len(surface.faces)))


def test_straight_walk_round_a_sphere_comes_back(surfaces):
    turn = 2 * np.pi * 25.0
    steps = np.full((1, 800), turn / 800)
    start = np.array([[25.0, 0.0, 0.0]])
    walk = surfaces["sphere"].walk(start, np.array([[0.0, 0.6, 0.8]]), steps)
    assert walk.complete.all()
    assert np.linalg.norm(walk.points_mm[0, -1] - start) < 0.006 * turn
    # A great circle stays in its plane.
    assert np.abs(walk.points_mm[0] @ [0.0, -0.8, 0.6]).max() < 0.3
    assert walk.directions[0, -1] @ [0.0, 0.6, 0.8] > 0.999


def test_walk_on_a_plate_is_exact_and_a_steady_turn_closes_a_circle(surfaces):
    plate = surfaces["plate"]
    start = np.array([[1.0, 2.0, 0.0]])
    walk = plate.walk(start, np.array([[1.0, 0.0, 0.0]]), np.array([[3.0, 2.0]]))
    np.testing.assert_allclose(walk.points_mm[0], [[4.0, 2.0, 0.0], [6.0, 2.0, 0.0]], atol=1e-13)
    steps, turns = np.full((1, 100), 0.2), np.full((1, 100), 2 * np.pi / 100)
    walk = plate.walk(start, np.array([[1.0, 0.0, 0.0]]), steps, turns)
    np.testing.assert_allclose(walk.points_mm[0, -1], start[0], atol=1e-12)
    # To the left: the circle lies on the side of n x t.
    assert walk.points_mm[0, :, 1].max() > 5.0


def test_walk_stops_at_an_edge(surfaces):
    walk = surfaces["plate"].walk(
        np.array([[38.0, 0.0, 0.0]]), np.array([[1.0, 0.0, 0.0]]), np.array([[1.0, 4.0]])
    )
    assert not walk.complete[0]
    inward = surfaces["plate"].walk(
        np.array([[38.0, 0.0, 0.0]]), np.array([[-1.0, 0.0, 0.0]]), np.array([[1.0, 4.0]])
    )
    assert inward.complete[0]


@pytest.mark.parametrize(("name", "per_mm"), [("plate", 0.0), ("sphere", 1 / 25)])
def test_curvature(surfaces, name, per_mm):
    surface = surfaces[name]
    site = surface.random_sites(
        np.random.default_rng(1), 1, (surface.normals[:, 2] > 0.5).astype(float)
    )[0]
    assert surface.curvature_per_mm(site, 1.5) == pytest.approx(per_mm, rel=0.35, abs=1e-12)


def test_tangent_axes_make_a_right_handed_frame():
    for normal in np.random.default_rng(0).normal(size=(20, 3)):
        unit = normal / np.linalg.norm(normal)
        frame = np.stack([*tangent_axes(unit), unit])
        np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-14)
        assert np.linalg.det(frame) == pytest.approx(1.0)
    site = Site(position_mm=np.zeros(3), normal=np.array([0.0, 0, 1]), heading_rad=0.4, triangle=0)
    left = np.cross(site.normal, site.direction())
    np.testing.assert_allclose(site.direction(np.pi / 2), left, atol=1e-15)
