"""A labelled scan: the reading, its noise-free twins with and without flaws, and exact labels."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from defects.kinds import KINDS
from pipeline.injection.flawed_part import FlawedPart
from pipeline.motion.trajectory import Trajectory
from pipeline.scan.detectability import Evidence, evidence_of
from pipeline.scan.labels import Tally, cross_boxes, differ, flaws_hit, stand_out, tally
from pipeline.seeds import RngOf
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.effects.row_repeat import RowRepeat, brightness_delivered
from sensors.line.brightness import Brightness
from sensors.model import SensorModel
from sensors.surface.albedo import Albedo
from sensors.surface.surface import Surface
from sensors.view.view import Reason, View

Floats = NDArray[np.float64]

HIDDEN_BY_FLAW: Final = 5  # the clean part would be seen by the camera here
REASON_NAMES: Final = {int(r): r.name.lower() for r in Reason} | {HIDDEN_BY_FLAW: "hidden_by_flaw"}
CLASS_NAMES: Final = {0: "background"} | {kind.class_id: name for name, kind in KINDS.items()}
SAME_MM: Final = 1e-6  # 1 nm: closer depths come from the same untouched surface


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Scan:
    """One scan with its labels; arrays are (n, m) profiles by points unless stated.

    Attributes
    ----------
    depth_mm : float64
        The reading, mm; NaN = missing.
    depth_ideal_mm, depth_clean_mm : float64
        Noise-free depth of the flawed and of the unflawed part from the true poses, mm.
    mask : uint8
        Class of the flaw whose face is hit, or that removed the surface hit on the clean part.
    mask_visible : uint8
        The same where the flaw's deviation exceeds the noise by the recipe's factor.
    instance : uint16
        Number of the flaw on its specimen, 0 = none.
    invalid_reason : uint8
        0 where the reading is valid; see `REASON_NAMES`.
    noise_mm : float64
        Claimed standard deviation of the reading, mm.
    poses, poses_true : (n, 4, 4) float64
        Commanded and true poses, sensor -> part.
    time_s : (n,) float64
    laser : Laser
    evidence : tuple
        What the scan shows of each flaw by its instance, see `pipeline.scan.detectability`.
    intensity : uint8 or None
        Brightness of the laser line, 255 = saturated, 0 where nothing is read.
    """

    depth_mm: Floats
    depth_ideal_mm: Floats
    depth_clean_mm: Floats
    mask: NDArray[np.uint8]
    mask_visible: NDArray[np.uint8]
    instance: NDArray[np.uint16]
    invalid_reason: NDArray[np.uint8]
    noise_mm: Floats
    poses: Floats
    poses_true: Floats
    time_s: Floats
    laser: Laser
    evidence: tuple[Evidence | None, ...]
    intensity: NDArray[np.uint8] | None = None

    def points_part_mm(self) -> Floats:
        """Return the readings as points (n, m, 3) in the part frame by the commanded poses, mm."""
        return self.laser.points_part_mm(self.depth_mm, self.poses)

    def tally(self, flaws: int) -> Tally:
        """Count the scan's points by the specimen's `flaws` flaws."""
        return tally(
            flaws,
            self.instance,
            self.mask_visible,
            self.invalid_reason,
            (int(Reason.HIDDEN_FROM_CAMERA), HIDDEN_BY_FLAW),
            self.depth_mm,
            self.depth_ideal_mm,
            self.depth_clean_mm,
            self.noise_mm,
        )


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Conditions:
    """What all scans of a specimen share: the instrument and the optical surface.

    Attributes
    ----------
    sensor, laser
        The instrument.
    surface, reflectance
        Roughness and albedo of the part; None: without.
    brightness
        Exposure and specular lobe, where the brightness is stored.
    visible_at
        A flaw is visible where its deviation exceeds this many standard deviations of the noise.
    """

    sensor: SensorModel
    laser: Laser
    visible_at: float
    surface: Surface | None = None
    reflectance: Albedo | None = None
    brightness: Brightness | None = None


def take_scan(
    flawed: FlawedPart,
    scenes: tuple[Scene, Scene],
    trajectory: Trajectory,
    conditions: Conditions,
    rng_of: RngOf,
) -> Scan:
    """Scan a specimen and label the visible flaws.

    Parameters
    ----------
    flawed
        The specimen.
    scenes
        The flawed and the clean solid, ready for casting.
    trajectory
        Commanded poses.
    conditions
        The instrument and the optical surface.
    rng_of
        Named streams of this scan.
    """
    scene, clean_scene = scenes
    sensor, reflectance = conditions.sensor, conditions.reflectance
    view, law = sensor.scan(
        View(
            scene, sensor, trajectory.poses, trajectory.time_s,
            laser=conditions.laser, reflectance=reflectance,
        ),
        conditions.surface,
        rng_of,
    )  # fmt: skip
    ideal_mm = view.depth_mm
    instance = flaws_hit(view.triangle, flawed.instance)
    brightness = conditions.brightness
    intensity = None if brightness is None else brightness.levels(view)
    view = view.posed(view.poses)  # poses and rays alone: its triangles' memory is needed
    depth, reason = law.sample(rng_of, view)
    law = replace(law, mean_mm=np.broadcast_to(np.nan, law.shape))  # its memory is needed
    clean = View(
        clean_scene, sensor, view.poses, view.time_s, laser=view.laser, reflectance=reflectance
    )
    _name_flaw_shadows(reason, ideal_mm, clean, flawed)
    clean_mm = clean.depth_mm
    del clean  # its triangles' memory is needed
    moved = np.flatnonzero(differ(instance, ideal_mm, clean_mm, SAME_MM))
    if moved.size:  # what a cut took away is the cut's, too
        rows, columns = np.divmod(moved, instance.shape[1])
        instance[rows, columns] = flawed.removed_at(_points(view, clean_mm, rows, columns))
    noise = law.sd_mm(view)
    mask, mask_visible = stand_out(
        instance, flawed.classes, depth, ideal_mm, clean_mm, noise, conditions.visible_at
    )
    evidence = evidence_of(
        len(flawed.flaws), instance, reason == HIDDEN_BY_FLAW, law, view, depth, ideal_mm, clean_mm
    )
    if intensity is not None:
        intensity[np.isnan(depth)] = 0
        if any(isinstance(e, RowRepeat) for e in sensor.effects):
            intensity = brightness_delivered(intensity, depth)
    return Scan(
        depth_mm=depth,
        depth_ideal_mm=ideal_mm,
        depth_clean_mm=clean_mm,
        mask=mask,
        mask_visible=mask_visible,
        instance=instance,
        invalid_reason=reason,
        noise_mm=noise,
        poses=trajectory.poses,
        poses_true=view.poses,
        time_s=trajectory.time_s,
        laser=conditions.laser,
        evidence=evidence,
        intensity=intensity,
    )


def _points(
    view: View, depth_mm: Floats, rows: NDArray[np.intp], columns: NDArray[np.intp]
) -> Floats:
    """Points (k, 3) of some pixels at the depths (n, m), part frame, mm."""
    depth = depth_mm[rows, columns]
    local = np.stack(
        [view.laser.x_mm[columns] + depth * view.laser.slope_x[columns], 0 * depth, depth], axis=-1
    )
    poses = view.poses[rows]
    return np.asarray(np.einsum("kij,kj->ki", poses[:, :3, :3], local) + poses[:, :3, 3])


def _name_flaw_shadows(
    reason: NDArray[np.uint8], ideal_mm: Floats, clean: View, flawed: FlawedPart
) -> None:
    """Tell points that a flaw hides from the camera from those that the part itself hides.

    A flaw has a hand in it only where it moved the point itself, or where material that it added
    may stand in the sight line; there the clean part is asked.
    """
    hidden = np.flatnonzero(reason == Reason.HIDDEN_FROM_CAMERA)
    hidden = hidden[clean.in_range.ravel()[hidden]]
    if hidden.size == 0:
        return
    rows, columns = np.divmod(hidden, reason.shape[1])
    points = _points(clean, clean.depth_mm, rows, columns)
    poses = clean.poses[rows]
    cameras = poses[:, :3, 1] * clean.datasheet.camera_offset_mm + poses[:, :3, 3]
    with np.errstate(invalid="ignore"):
        off = np.abs(ideal_mm[rows, columns] - clean.depth_mm[rows, columns])
    asked = ~(off <= SAME_MM) | cross_boxes(points, cameras, _added_boxes_mm(flawed))
    rows, columns, points, cameras = rows[asked], columns[asked], points[asked], cameras[asked]
    triangle = clean.triangle[rows, columns]
    facing = np.einsum("ik,ik->i", clean.scene.normals[triangle], cameras - points) > 0
    seen = facing & ~clean.scene.blocked(points, cameras, triangle)
    reason[rows[seen], columns[seen]] = HIDDEN_BY_FLAW


def _added_boxes_mm(flawed: FlawedPart) -> Floats:
    """Least and greatest corners (b, 2, 3) of what flaws added, part frame, mm, and 1 µm more."""
    added = [cutter.added.vertices_mm for cutter in flawed.cutters if cutter.added is not None]
    boxes = [[v.min(axis=0) - 1e-3, v.max(axis=0) + 1e-3] for v in added]
    return np.array(boxes, dtype=np.float64).reshape(-1, 2, 3)
