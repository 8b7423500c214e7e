"""Second light of the bench, against a V groove's closed form."""

import numpy as np
import pytest
import trimesh

from benchmarks.other_formulas.formulas.light import facing_wall
from benchmarks.other_formulas.instrument import PITCH_MM, Instrument, Scan
from benchmarks.other_formulas.shot import View
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet

DISTANCE_MM, DEEP_MM = 100.0, 5.0
FACING = np.diag([1.0, -1.0, -1.0])


def groove(across: np.ndarray) -> Scene:
    """A groove with walls at 45 degrees, 10 mm wide; `across` is its axis across, x or y."""
    half, long = DEEP_MM, 60.0
    along = np.array([across[1], -across[0], 0.0])
    profile = [(-30.0, 0.0), (-half, 0.0), (0.0, -DEEP_MM), (half, 0.0), (30.0, 0.0)]
    points = np.array([
        u * across + w * np.array([0.0, 0.0, 1.0]) + s * along
        for s in (-long, long) for u, w in profile
    ])  # fmt: skip
    faces = [f for k in range(4) for f in ((k, k + 1, k + 6), (k, k + 6, k + 5))]
    mesh = trimesh.Trimesh(points, faces, process=False)
    if mesh.face_normals[0, 2] < 0:
        mesh.invert()
    return Scene(np.asarray(mesh.vertices), np.asarray(mesh.faces))


def looked_at(across: np.ndarray) -> View:
    sheet = Datasheet(
        name="vertical", working_distance_mm=DISTANCE_MM, z_range_mm=40.0, x_fov_mm=20.0,
        points_per_profile=101, z_resolution_um=1.0, repeatability_um=2.0, profile_rate_hz=100.0,
        travel_speed_mm_s=30.0, columns="even_x", triangulation_angle_deg=30.0, camera_side="+y",
    )  # fmt: skip
    poses = np.tile(np.eye(4), (41, 1, 1))
    poses[:, :3, :3] = FACING
    poses[:, 1, 3] = -PITCH_MM * (np.arange(41) - 20)
    poses[:, 2, 3] = DISTANCE_MM
    scan = Scan(poses=poses, error=np.eye(4), time_s=np.arange(41) / 100.0, start_s=0.0)
    maker = Instrument(sheet=sheet, left_out=(), noise_mm=0.01, wobble=np.zeros((4, 3)))
    return View(scene=groove(across), instrument=maker, scan=scan)


def test_light_that_crosses_the_line_is_read_where_the_camera_sees_it() -> None:
    """From a wall at y the ray goes level to -y, and the camera's line meets the plane below."""
    view = looked_at(np.array([0.0, 1.0, 0.0]))
    distance, ghost = facing_wall(view, 8.0)
    y = view.scan.poses[:, 1, 3]
    row = int(np.argmin(np.abs(y - 1.8)))
    way = 2 * y[row]
    depth = DISTANCE_MM + DEEP_MM - y[row]
    read = depth / (1 - way / view.camera_y_mm)  # the sensor's y points against the part's
    assert distance[row, 50] == pytest.approx(way, abs=0.05)
    assert depth + ghost[row, 50] == pytest.approx(read, abs=0.05)


def test_light_that_goes_along_the_line_is_read_as_the_column_s_own() -> None:
    """Both walls lie in the laser's plane: the second spot is where that column's first is."""
    distance, ghost = facing_wall(looked_at(np.array([1.0, 0.0, 0.0])), 8.0)
    there = np.isfinite(distance)
    assert there.mean() > 0.2
    assert np.abs(ghost[there]).max() < 0.25  # a column's pitch is 0.2 mm
