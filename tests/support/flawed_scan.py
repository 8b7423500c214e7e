"""A plate with one flaw, its labelled scan, and the recording that a real sensor would give."""

import numpy as np
import trimesh

from flawforge.flaw.extraction import Region
from pipeline.injection.flawplan import FlawPlan, exactly
from pipeline.injection.inject import inject
from pipeline.motion.trajectory import Trajectory, frame
from pipeline.parts.part import Part
from pipeline.scan.labelled_scan import Conditions, take_scan
from pipeline.seeds import streams
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet
from sensors.model import SensorModel
from sensors.recording import Recording
from sensors.surface.surface import Surface

SHEET = Datasheet(
    name="s",
    working_distance_mm=100.0,
    z_range_mm=60.0,
    x_fov_mm=40.0,
    points_per_profile=160,
    z_resolution_um=1.0,
    repeatability_um=2.0,
    profile_rate_hz=500.0,
    triangulation_angle_deg=30.0,
)
MADE = {
    "dent": {"length_mm": 10.0, "aspect": 0.6, "depth_mm": 0.15},
    "scratch": {"length_mm": 9.0, "width_mm": 0.8, "depth_mm": 0.08},
    "pit": {"diameter_mm": 2.5, "depth_mm": 0.4},
    "bump": {"length_mm": 3.0, "height_mm": 0.4},
    "corrosion": {"length_mm": 8.0, "depth_mm": 0.3},
}
OFF_MM = 0.2


def plate(thickness=5.0):
    box = trimesh.creation.box(extents=(60, 60, thickness))
    for _ in range(4):
        box = box.subdivide()
    return Part(name="plate", vertices_mm=box.vertices, faces=box.faces)


def middle_only(part):
    centre = part.vertices_mm[part.faces].mean(axis=1)
    return (np.abs(centre[:, :2]) < 6).all(axis=1) & (centre[:, 2] > 0)


def scanned(part, kind, *, sheet=SHEET, seed=1, surface=None, faces=middle_only, **sizes):
    rng_of = streams(seed, "test")
    flawed = inject(
        part,
        FlawPlan(kinds=(exactly(kind, 1, **sizes),)),
        visible_faces=faces(part),
        visible_at=lambda points: (np.abs(points[:, :2]) < 12).all(axis=1),
        rng_of=rng_of,
    )
    assert len(flawed.flaws) == 1
    poses = np.tile(np.eye(4), (160, 1, 1))
    poses[:, :3, :3] = frame((0, 0, -1), (0, 1, 0))
    poses[:, 1, 3] = np.linspace(-20, 20, 160)
    poses[:, 2, 3] = 100 + part.vertices_mm[:, 2].max()
    path = Trajectory(poses=poses, time_s=np.arange(160) / 500, facts={})
    scenes = (Scene(flawed.vertices_mm, flawed.faces), Scene(part.vertices_mm, part.faces))
    conditions = Conditions(
        sensor=SensorModel(sheet), laser=Laser.from_datasheet(sheet), surface=surface,
        visible_at=3.0,
    )  # fmt: skip
    return flawed, take_scan(flawed, scenes, path, conditions, rng_of)


def recorded(part, kind, **sizes):
    """Return a flawed part, its scan, and the recording that a stage 0.2 mm off would give."""
    flawed, scan = scanned(part, kind, surface=Surface.load("car_door"), **sizes)
    poses = scan.poses.copy()
    poses[:, 2, 3] += OFF_MM
    return flawed, scan, Recording(
        name="made", depth_mm=scan.depth_mm, poses=poses, time_s=scan.time_s
    )  # fmt: skip


def around(flawed, reach_mm=9.0):
    x, y = flawed.flaws[0].position_mm[:2]
    return Region(box_mm=(x - reach_mm, y - reach_mm, x + reach_mm, y + reach_mm))
