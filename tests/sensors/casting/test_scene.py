"""First hits against closed forms: plane, sphere, cylinder, exact facets."""

import pickle
from fractions import Fraction

import numpy as np
import pytest
import trimesh

from sensors.casting.laser import Laser
from sensors.casting.scene import Scene, frames, legs
from tests.support.solids import LASERS, path, rotation, scene_of

FAN = Laser(x_mm=np.zeros(301), slope_x=np.tan(np.linspace(-0.2, 0.2, 301)))


def sensor_points(laser, hits):
    return laser.points_mm(hits.depth_mm)


def test_a_tilted_plane_reads_its_own_equation():
    box = trimesh.creation.box((300, 300, 30))
    tilt = trimesh.transformations.euler_matrix(0.2, -0.3, 0)[:3, :3]
    poses = path(np.array([0, 0, -15.0]), 20, 9, turned=tilt, height_mm=400)
    hits = scene_of(box).cast(FAN, poses)
    # The box's upper face is z = -15: in the sensor frame n·p = -15 with n = R^T z.
    normal = poses[:, 2, :3]
    offset = -15 - poses[:, 2, 3]
    expected = offset[:, None] / (normal[:, :1] * FAN.slope_x + normal[:, 2:])
    np.testing.assert_allclose(hits.depth_mm, expected, rtol=0, atol=1e-9)


def test_a_sphere_is_met_within_its_facets_sagitta():
    ball = trimesh.creation.icosphere(subdivisions=5, radius=50)
    longest = ball.edges_unique_length.max()
    sagitta = 50 - np.sqrt(50**2 - longest**2 / 3)  # circumradius of the largest facets
    hits = scene_of(ball).cast(FAN, path(np.zeros(3), 40, 41, height_mm=400))
    y = np.linspace(-40, 40, 41)[:, None]
    radius = np.sqrt(
        (hits.depth_mm * FAN.slope_x) ** 2 + y**2 + (hits.depth_mm - 400) ** 2
    )
    met = hits.triangle >= 0
    assert met.sum() > 3000
    assert (radius[met] <= 50 + 1e-9).all()
    assert (radius[met] >= 50 - 1.01 * sagitta).all()


def test_a_cylinder_is_met_within_its_facets_sagitta():
    sections = 256
    tube = trimesh.creation.cylinder(30, 200, sections=sections)
    tube.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, (1, 0, 0)))
    hits = scene_of(tube).cast(FAN, path(np.zeros(3), 50, 11, height_mm=400))
    radius = np.hypot(hits.depth_mm * FAN.slope_x, hits.depth_mm - 400)
    met = hits.triangle >= 0
    assert met.any()
    assert (radius[met] <= 30 + 1e-9).all()
    assert (radius[met] >= 30 * np.cos(np.pi / sections) - 1e-9).all()


def exact_depth(corners, start, way):
    """Ray parameter at a triangle's plane, in rational numbers."""
    a, b, c = ([Fraction(float(v)) for v in corner] for corner in corners)
    o, d = [Fraction(float(v)) for v in start], [Fraction(float(v)) for v in way]
    u, v = [y - x for x, y in zip(a, b, strict=True)], [y - x for x, y in zip(a, c, strict=True)]
    n = [
        u[1] * v[2] - u[2] * v[1],
        u[2] * v[0] - u[0] * v[2],
        u[0] * v[1] - u[1] * v[0],
    ]
    above = sum(k * (x - y) for k, x, y in zip(n, a, o, strict=True))
    return above / sum(k * x for k, x in zip(n, d, strict=True))


@pytest.mark.parametrize("caster", ["cast", "cast_by_tree"])
@pytest.mark.parametrize("away_mm", [0.0, 5000.0])
def test_a_hit_is_the_exact_point_of_its_facet_to_a_nanometre(caster, away_mm):
    rng = np.random.default_rng(7)
    ball = trimesh.creation.icosphere(subdivisions=4, radius=50)
    ball.vertices += rng.normal(size=ball.vertices.shape) * 0.3 + [away_mm, -away_mm, away_mm / 2]
    scene = scene_of(ball)
    # The sensor looks along the part's axes, so that pose and rays are exact numbers.
    poses = path(np.array([away_mm, -away_mm, away_mm / 2]), 32, 33, height_mm=400)
    hits = getattr(scene, caster)(FAN, poses)
    rows, columns = np.nonzero(hits.triangle >= 0)
    for k in rng.choice(len(rows), 300, replace=False):
        i, j = rows[k], columns[k]
        triangle = hits.triangle[i, j]
        way = (FAN.slope_x[j], 0.0, 1.0)
        corners = scene.vertices_mm[scene.faces[triangle]]
        exact = float(exact_depth(corners, poses[i, :3, 3], way))
        assert abs(hits.depth_mm[i, j] - exact) < 1e-6
        point = poses[i, :3, 3] + exact * np.array(way)
        inside = trimesh.triangles.points_to_barycentric(corners[None], point[None])[0]
        assert inside.min() > -1e-9


def test_a_ray_that_meets_nothing_says_so():
    hits = scene_of(trimesh.creation.box((10, 10, 10))).cast(
        FAN, path(np.array([200.0, 0, 0]), 5, 3)
    )
    assert np.isnan(hits.depth_mm).all()
    assert (hits.triangle == -1).all()


def test_what_lies_behind_the_emitter_is_not_seen():
    box = trimesh.creation.box((20, 20, 4))
    poses = path(np.zeros(3), 5, 101, height_mm=-30)
    for laser in LASERS.values():
        assert (scene_of(box).cast(laser, poses).triangle == -1).all()
    # Walls that reach from behind the emitter to before it are cut off there.
    well = trimesh.boolean.difference(
        [trimesh.creation.box((40, 40, 40)), trimesh.creation.box((20, 200, 60))]
    )
    hits = scene_of(well).cast(FAN, path(np.zeros(3), 5, 401, height_mm=0))
    # Walls at x = ±10: depth 10 / |slope|, up to the end of the block at z = 20.
    with np.errstate(divide="ignore"):
        depth = 10 / np.abs(FAN.slope_x)
    expected = np.where(depth < 20, depth, np.nan)
    np.testing.assert_allclose(hits.depth_mm, np.tile(expected, (401, 1)), atol=1e-9)


def test_a_scene_survives_pickling():
    scene = scene_of(trimesh.creation.icosphere(2, 30))
    copy = pickle.loads(pickle.dumps(scene))
    poses = path(np.zeros(3), 20, 5)
    a, b = scene.cast(FAN, poses), copy.cast(FAN, poses)
    np.testing.assert_array_equal(a.depth_mm, b.depth_mm)
    np.testing.assert_array_equal(a.triangle, b.triangle)


def test_a_scene_is_never_written_to():
    scene = scene_of(trimesh.creation.box((1, 1, 1)))
    for array in (scene.vertices_mm, scene.faces, scene.normals):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_the_callers_arrays_stay_the_callers():
    vertices = np.array(trimesh.creation.box((1, 1, 1)).vertices)
    faces = np.array(trimesh.creation.box((1, 1, 1)).faces, dtype=np.int32)
    scene = Scene(vertices, faces)
    vertices += 1.0
    assert vertices.flags.writeable
    assert scene.vertices_mm.max() == 0.5


@pytest.mark.parametrize(
    ("vertices", "faces", "what"),
    [
        (np.zeros((3, 2)), [[0, 1, 2]], "vertices_mm must be"),
        (np.zeros((3, 3)), [[0, 1]], "faces must be"),
        (np.full((3, 3), np.nan), [[0, 1, 2]], "finite"),
        (np.zeros((3, 3)), [[0, 1, 3]], "existing"),
        (np.zeros((3, 3)), np.zeros((0, 3)), "faces must be"),
    ],
)
def test_arrays_that_are_no_mesh_are_refused(vertices, faces, what):
    with pytest.raises(ValueError, match=what):
        Scene(vertices, np.asarray(faces))


def test_legs_are_the_runs_of_one_orientation():
    rng = np.random.default_rng(0)
    a, b = rotation(rng), rotation(rng)
    frame = np.stack([a, a, a, b, b, a])
    assert legs(frame) == [slice(0, 3), slice(3, 5), slice(5, 6)]
    # A slow turn doesn't pass for one orientation by small steps.
    slow = np.tile(np.eye(3), (50, 1, 1))
    slow[:, 0, 1] = np.arange(50) * 0.4e-13
    assert max(leg.stop - leg.start for leg in legs(slow)) == 3


def test_frames_place_the_sensor_in_its_own_axes():
    rng = np.random.default_rng(1)
    poses = path(rng.normal(size=3), 5, 4, turned=rotation(rng))
    frame, place = frames(poses)
    back = np.einsum("nji,nj->ni", frame, place)
    np.testing.assert_allclose(back, poses[:, :3, 3], atol=1e-12)


def test_a_path_of_several_legs_is_cast_leg_by_leg():
    rng = np.random.default_rng(3)
    ball = trimesh.creation.icosphere(3, 30)
    legs_of_path = [path(np.zeros(3), 25, 12, turned=rotation(rng)) for _ in range(3)]
    scene = scene_of(ball)
    whole = scene.cast(FAN, np.concatenate(legs_of_path))
    parts = [scene.cast(FAN, leg) for leg in legs_of_path]
    np.testing.assert_array_equal(whole.depth_mm, np.concatenate([p.depth_mm for p in parts]))
    np.testing.assert_array_equal(whole.triangle, np.concatenate([p.triangle for p in parts]))


def test_a_turning_sensor_sees_the_sphere_from_all_sides():
    ball = trimesh.creation.icosphere(4, 30)
    poses = np.tile(np.eye(4), (40, 1, 1))
    for k, angle in enumerate(np.linspace(0, 2 * np.pi, 40)):
        poses[k] = trimesh.transformations.rotation_matrix(angle, (0, 1, 0))
        poses[k, :3, 3] = -100 * poses[k, :3, 2]
    hits = scene_of(ball).cast(FAN, poses)
    radius = np.hypot(hits.depth_mm * FAN.slope_x, hits.depth_mm - 100)
    met = hits.triangle >= 0
    assert met[:, 150].all()
    assert radius[met].max() <= 30 + 1e-9
    assert radius[met].min() > 29.9


@pytest.mark.parametrize("subdivisions", [2, 5])
def test_the_choice_of_caster_changes_nothing(subdivisions):
    ball = trimesh.creation.icosphere(subdivisions, 30)
    poses = path(np.zeros(3), 25, 30)
    for k, angle in enumerate(np.linspace(-0.1, 0.1, 20)):
        poses[k, :3, :3] = trimesh.transformations.euler_matrix(angle, 0, angle)[:3, :3]
    scene = scene_of(ball)
    before = scene.cast(FAN, poses)
    searched = scene.cast_by_tree(FAN, poses)
    after = scene.cast(FAN, poses)  # now that there is a tree
    for other in (searched, after):
        np.testing.assert_array_equal(before.depth_mm, other.depth_mm)
        np.testing.assert_array_equal(before.triangle, other.triangle)
