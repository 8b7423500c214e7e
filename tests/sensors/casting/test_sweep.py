"""The sweep against the refined Embree caster, bit by bit, and against closed forms."""

import numpy as np
import pytest
import trimesh

from pipeline.parts.builtin import build
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene, frames
from sensors.casting.sweep import sweep, sweepable
from tests.support.solids import LASERS, path, rotation, scene_of, solids

NAMES = [name for name, _ in solids(np.random.default_rng(0))]


def assert_same(scene, laser, poses):
    swept, searched = scene.cast(laser, poses), scene.cast_by_tree(laser, poses)
    np.testing.assert_array_equal(swept.triangle, searched.triangle)
    np.testing.assert_array_equal(swept.depth_mm, searched.depth_mm)
    return swept


@pytest.mark.parametrize("laser", LASERS)
@pytest.mark.parametrize("name", NAMES)
def test_both_casters_agree_to_the_last_bit(name, laser):
    rng = np.random.default_rng([NAMES.index(name), list(LASERS).index(laser)])
    mesh = dict(solids(rng))[name]
    for away_mm in (0.0, 1e4):
        mesh.vertices += [away_mm, -away_mm / 3, away_mm / 7]
        # Along the part's axes: many edges and vertices lie exactly on profiles and on rays.
        hits = assert_same(scene_of(mesh), LASERS[laser], path(mesh.bounds.mean(axis=0), 40, 81))
        assert (hits.triangle >= 0).mean() > 0.02
        # Askew, in any order of profiles, the path bent sideways and in height.
        poses = path(mesh.bounds.mean(axis=0), 40, 81, turned=rotation(rng))
        poses[:, :3, 3] += rng.normal(size=(81, 3)) * 0.3
        assert_same(scene_of(mesh), LASERS[laser], poses[rng.permutation(81)])


@pytest.mark.parametrize("rays", [1, 2, 3])
@pytest.mark.parametrize("laser", LASERS)
def test_profiles_of_few_rays(laser, rays):
    some = np.linspace(0, len(LASERS[laser].x_mm) - 1, rays + 2).astype(int)[1:-1]
    few = Laser(x_mm=LASERS[laser].x_mm[some], slope_x=LASERS[laser].slope_x[some])
    poses = path(np.zeros(3), 30, 81, turned=rotation(np.random.default_rng(rays)))
    ball = scene_of(trimesh.creation.icosphere(4, radius=20.0))
    depth, triangle = sweep(
        ball.vertices_mm, ball.faces, frames(poses)[0][0], frames(poses)[1],
        few.x_mm, few.slope_x,
    )  # fmt: skip
    searched = ball.cast_by_tree(few, poses)
    np.testing.assert_array_equal(triangle, searched.triangle)
    np.testing.assert_array_equal(depth, searched.depth_mm)


def test_edges_on_rays_and_profiles_are_met_exactly_once():
    # A grid of squares whose edges lie on the parallel rays and on the profiles.
    block = trimesh.creation.box((8, 8, 2))
    for _ in range(3):
        block = block.subdivide()
    laser = Laser(x_mm=np.arange(-5.0, 5.5, 0.5), slope_x=np.zeros(21))
    hits = assert_same(scene_of(block), laser, path(np.zeros(3), 5, 21))
    # Half-open: of two opposite rims one counts as met, so the area is right.
    assert (hits.triangle >= 0).sum() == 16 * 16
    assert np.nanmin(hits.depth_mm) == np.nanmax(hits.depth_mm) == 99.0


@pytest.mark.parametrize("angle", [0.0, 1e-15, 1e-12, 1e-9, 1e-6, -1e-9])
def test_faces_along_the_rays_are_grazed_alike(angle):
    box = trimesh.creation.box((40, 30, 60))
    box.apply_transform(trimesh.transformations.rotation_matrix(angle, (0.3, 1, 0)))
    laser = Laser(x_mm=np.linspace(-20, 20, 41), slope_x=np.zeros(41))
    hits = assert_same(scene_of(box), laser, path(np.zeros(3), 15, 31))
    assert (hits.triangle >= 0).mean() > 0.9


def test_triangles_far_smaller_than_a_point_leave_no_hole():
    ball = trimesh.creation.icosphere(subdivisions=6, radius=3)  # edges of 0.05 mm
    hits = assert_same(
        scene_of(ball), LASERS["parallel"], path(np.zeros(3), 2, 41)
    )  # 0.5 mm apart
    x, y = np.meshgrid(LASERS["parallel"].x_mm, np.linspace(-2, 2, 41))
    inside = np.hypot(x, y) < 2.99
    assert (hits.triangle[inside] >= 0).all()
    depth = 100 - np.sqrt(9 - x[inside] ** 2 - y[inside] ** 2)
    np.testing.assert_allclose(hits.depth_mm[inside], depth, atol=2e-3)


def test_slivers_and_needles_read_their_plane():
    # A plate whose upper face is a fan of needles around a point beside its middle.
    rim = np.linspace(0, 2 * np.pi, 2000, endpoint=False)
    ring = np.stack([40 * np.cos(rim), 40 * np.sin(rim)], axis=-1)
    top = np.column_stack([ring, np.zeros(2000)])
    vertices = np.concatenate([top, top + [0, 0, 5], [[7, 3, 0], [7, 3, 5]]])
    i = np.arange(2000)
    k = np.roll(i, -1)
    faces = np.concatenate(
        [
            np.column_stack([k, i, np.full(2000, 4000)]),
            np.column_stack([i + 2000, k + 2000, np.full(2000, 4001)]),
            np.column_stack([i, k, k + 2000]),
            np.column_stack([i, k + 2000, i + 2000]),
        ]
    )
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    assert mesh.volume > 0
    tilt = trimesh.transformations.euler_matrix(0.1, 0.2, 0.3)[:3, :3]
    poses = path(np.zeros(3), 20, 41, turned=tilt)
    hits = assert_same(scene_of(mesh), LASERS["fan"], poses)
    middle = hits.depth_mm[:, 70:130]
    normal, start = tilt[2], poses[:, :3, 3]
    slope = LASERS["fan"].slope_x[70:130]
    expected = -start[:, 2:] / (normal[0] * slope + normal[2])
    np.testing.assert_allclose(middle, expected, rtol=0, atol=1e-9)


def test_of_two_faces_at_one_place_the_lower_number_is_named():
    box = trimesh.creation.box((20, 20, 4))
    vertices = np.concatenate([box.vertices, box.vertices])
    scene = Scene(vertices, np.concatenate([box.faces, box.faces + 8]))
    poses = path(np.zeros(3), 8, 17)
    hits = scene.cast(LASERS["fan"], poses)
    assert 0 <= hits.triangle.max() < len(box.faces)
    # The tree may name either; the depth is the same.
    searched = scene.cast_by_tree(LASERS["fan"], poses)
    np.testing.assert_array_equal(searched.depth_mm, hits.depth_mm)


def test_rays_that_cross_are_left_to_the_tree():
    crossing = Laser(x_mm=np.linspace(-30, 30, 61), slope_x=np.linspace(0.4, -0.4, 61))
    assert not sweepable(crossing.x_mm, crossing.slope_x)
    box = trimesh.creation.box((40, 40, 10))
    hits = scene_of(box).cast(crossing, path(np.zeros(3), 10, 11))
    inside = np.abs(crossing.x_mm + 95 * crossing.slope_x) < 19.9
    assert (hits.depth_mm[:, inside] == 95).all()
    for laser in LASERS.values():
        assert sweepable(laser.x_mm, laser.slope_x)


def test_one_profile_and_one_point_are_enough():
    box = scene_of(trimesh.creation.box((40, 40, 10)))
    one = Laser(x_mm=np.zeros(1), slope_x=np.zeros(1))
    frame, place = frames(path(np.zeros(3), 0, 1))
    depth, triangle = sweep(
        box.vertices_mm, box.faces, frame[0], place, one.x_mm, one.slope_x
    )
    assert depth.shape == triangle.shape == (1, 1)
    assert depth[0, 0] == 95
    assert box.cast(one, np.empty((0, 4, 4))).depth_mm.shape == (0, 1)


def test_depth_doesnt_depend_on_the_profiles_beside_it():
    rng = np.random.default_rng(6)
    mesh = dict(solids(rng))["pockets"]
    poses = path(np.zeros(3), 30, 61, turned=rotation(rng))
    whole = scene_of(mesh).cast(LASERS["fan"], poses)
    some = scene_of(mesh).cast(LASERS["fan"], poses[10:40:3])
    np.testing.assert_array_equal(whole.depth_mm[10:40:3], some.depth_mm)


@pytest.mark.parametrize("part", ["bearing_cap", "car_door", "steel_plate"])
def test_both_casters_agree_on_the_built_in_parts(part):
    built = build(part)
    scene = Scene(built.vertices_mm, built.faces)
    low, high = scene.vertices_mm.min(axis=0), scene.vertices_mm.max(axis=0)
    centre = (low + high) / 2
    half = (high - low)[1] / 2
    laser = Laser(x_mm=np.zeros(600), slope_x=np.tan(np.linspace(-0.55, 0.55, 600)))
    for turned in (
        trimesh.transformations.euler_matrix(np.pi, 0, 0)[:3, :3],
        trimesh.transformations.euler_matrix(np.pi + 0.1, 0.2, 0.3)[:3, :3],
    ):
        poses = path(centre, half, 150, turned=turned, height_mm=400)
        hits = assert_same(scene, laser, poses)
        assert (hits.triangle >= 0).mean() > 0.05
