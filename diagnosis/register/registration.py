"""Registration: where the part really was and where the travel went, a nuisance of nine numbers.

Gauss-Newton on the depth residual with the analytic derivative of depth by pose, robust, with
edges and creases down-weighted; directions that smooth faces leave open are then settled by the
silhouettes, if there are any. The same columns are projected out of every later test.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, maximum_filter, minimum_filter
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from diagnosis.fields import Field, Mask
from diagnosis.noise.noise_model import mad_sd
from diagnosis.register.coordinate_search import step_by_step
from diagnosis.register.part_unit import unit_hint
from diagnosis.register.pose_derivative import (
    pose_columns,
    travel_columns,
    travel_vector,
    turned_ways,
)
from files.errors import RecipeError
from sensors.casting.hits import Hits
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet
from sensors.recording import Recording
from sensors.view.visibility import camera_visible

PRIOR_SD = np.array([2.0, 2.0, 2.0, 0.02, 0.02, 0.02, 3e-4, 1e-3, 1e-3])
"""How far a commanded pose may be off: mm, radians, share of the travel, its direction.

A part lies anywhere; a stage's way is right to a few hundred ppm and its sensor sits on it to a
milliradian (makers' data of linear stages). What turns with a part's tilt isn't told apart by flat
faces, so that a wider prior would bend the travel for nothing; where readings tell, it hardly
matters.
"""
SUBSET = 120_000
MOVE_LIMIT = np.array([1.0, 1.0, 1.0, 0.01, 0.01, 0.01, 1e-3, 5e-3, 5e-3])
"""Largest step of one iteration: mm, radians, share of the travel, its direction."""
OPEN = 0.01
"""Deviation, in pitches, from which a direction is left to the silhouettes.

Planes say nothing of where they end: walls and what is read between two levels do, and those may be
blurred over many pitches. Their word was up to two pitches off, with a deviation of 0.01 to 0.1.
"""
STEP = 0.3
"""Depth, in pitches, by which a silhouette stands out at least."""
REACHES = (8.0, 3.0, 1.0, 0.4, 0.15, 0.05)
"""Steps of a search by silhouettes, in pitches."""
LEAST_SETTLED = 5.0
"""What silhouettes must save to be followed: five readings on the wrong side of one."""
SHADE = 3
"""Pitches by which a shadow's end may be off."""
LEAST_MET, LEAST_SHARE_MET = 50, 0.02
"""Readings, and share of a recording's, that must meet the part from the commanded poses."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Placement:
    """A correction of all poses of one recording.

    A part that lies elsewhere moves all poses alike; a sensor that sits askew on its stage travels
    in another direction than its axes say.

    Attributes
    ----------
    shift : (9,) float64
        Translation (part frame, mm), rotation vector about `centre_mm` (part frame, rad), scale
        of the travel, and its turn towards the sensor's x and z (rad).
    centre_mm : (3,) float64
        Centre of the hits, part frame.
    covariance : (9, 9) float64
        Of the shift, with readings counted as independent.
    poses : (n, 4, 4) float64
        The commanded poses with the correction applied.
    """

    shift: Field
    centre_mm: Field
    covariance: Field
    poses: Field

    def moved_by(self, steps: Field) -> "Placement":
        """Return the placement with its poses moved by a shift (9,), in prior deviations."""
        return replace(
            self,
            shift=self.shift + PRIOR_SD * steps,
            poses=move(self.poses, PRIOR_SD * steps, self.centre_mm),
        )

    def further(self, steps: Field) -> "Placement":
        """Return the placement with a small shift (9,), in prior deviations, added."""
        return replace(self, shift=self.shift + PRIOR_SD * steps)


def move(poses: Field, shift: Field, centre_mm: Field) -> Field:
    """Apply a correction (9,) to commanded poses (n, 4, 4)."""
    moved = poses.copy()
    moved[:, :3, 3] += travel_columns(poses) @ shift[6:]
    turn = Rotation.from_rotvec(shift[3:6]).as_matrix()
    moved[:, :3, :3] = turn @ moved[:, :3, :3]
    moved[:, :3, 3] = (moved[:, :3, 3] - centre_mm) @ turn.T + centre_mm + shift[:3]
    return moved


def smooth_weight(depth_mm: Field, normal: Field, pitch_mm: float) -> Field:
    """Weight 1 on smooth faces, 0 at depth edges, 0.2 by creases and corners; (n, m).

    Works on a grid whose neighbours lie `pitch_mm` apart or more.
    """
    finite = np.isfinite(depth_mm)
    size = (3, 3)
    gap = ~minimum_filter(finite, size, mode="nearest")
    high = maximum_filter(np.where(finite, depth_mm, -np.inf), size, mode="nearest")
    low = minimum_filter(np.where(finite, depth_mm, np.inf), size, mode="nearest")
    jump = np.where(finite, high - low, 0.0) > 6 * pitch_mm
    turned = np.zeros(depth_mm.shape, dtype=bool)
    for axis in (0, 1):
        dot = np.einsum("nmk,nmk->nm", normal, np.roll(normal, 1, axis=axis))
        bent = dot < np.cos(np.radians(12))
        bent[0 if axis == 0 else slice(None), 0 if axis == 1 else slice(None)] = False
        turned |= bent | np.roll(bent, -1, axis=axis)
    weight = np.ones(depth_mm.shape)
    weight[binary_dilation(turned, iterations=2)] = 0.2
    weight[binary_dilation(gap | jump, iterations=1) | ~finite] = 0.0
    return weight


def register(
    scene: Scene,
    recording: Recording,
    laser: Laser,
    *,
    datasheet: Datasheet,
    valid: Mask,
    offset_mm: Field | None = None,
    sd_mm: float = 0.0,
    spread: Field | None = None,
) -> Placement:
    """Fit the placement of one recording.

    Parameters
    ----------
    datasheet : Datasheet
        Where the camera is, if stated.
    valid : (n, m) bool
        Readings to use.
    offset_mm : (n, m), optional
        What the model expects beyond the geometric depth, mm.
    sd_mm : float
        Noise of a reading where known; guards the robust scale against zero.
    spread : (n, m), optional
        What each reading's noise is larger or smaller by.

    Raises
    ------
    RecipeError
        Where the recording and the part don't overlap or are of different units.
    """
    rows, columns = _subset(recording.depth_mm.shape)
    pick = np.ix_(rows, columns)
    poses = recording.poses[rows]
    rays = Laser(x_mm=laser.x_mm[columns], slope_x=laser.slope_x[columns])
    expected = np.zeros((rows.size, columns.size)) if offset_mm is None else offset_mm[pick]
    depth = np.where(valid[pick], recording.depth_mm[pick], np.nan) - np.nan_to_num(expected)
    points, together = _met(scene, rays, poses, depth, recording.name)
    centre = points.mean(axis=0)
    pitch = pitch_of(points, together.shape)
    larger = np.ones(depth.shape) if spread is None else spread[pick]
    shift, covariance = _smooth_fit(scene, rays, poses, depth, centre, pitch, sd_mm, larger)
    shift = _settle_by_edges(
        scene, rays, poses, depth, centre, shift, covariance, pitch, sd_mm, datasheet
    )
    return Placement(
        shift=shift,
        centre_mm=centre,
        covariance=covariance,
        poses=_move_all(recording.poses, poses, shift, centre),
    )


def check_meets(scene: Scene, recording: Recording, laser: Laser, *, valid: Mask) -> None:
    """Refuse a recording that misses the part from its commanded poses.

    Raises
    ------
    RecipeError
        Where too few of its rays meet the part, or it would fit in another unit.
    """
    rows, columns = _subset(recording.depth_mm.shape)
    pick = np.ix_(rows, columns)
    rays = Laser(x_mm=laser.x_mm[columns], slope_x=laser.slope_x[columns])
    depth = np.where(valid[pick], recording.depth_mm[pick], np.nan)
    poses = recording.poses[rows]
    _met(scene, rays, poses, depth, recording.name)
    hint = unit_hint(scene, rays, poses, depth)
    if hint is not None:
        raise RecipeError(hint, where=recording.name)


def _met(
    scene: Scene, rays: Laser, poses: Field, depth: Field, name: str
) -> tuple[Field, Mask]:
    """Points (k, 3) of the part that rays with a reading meet, and which rays these are."""
    first = scene.cast(rays, poses)
    together = np.isfinite(first.depth_mm) & np.isfinite(depth)
    if together.sum() < max(LEAST_MET, LEAST_SHARE_MET * np.isfinite(depth).sum()):
        raise RecipeError(overlap_fault(scene, rays, poses, depth), where=name)
    return _points(poses, rays, first.depth_mm)[together], together


def _smooth_fit(
    scene: Scene,
    rays: Laser,
    poses: Field,
    depth: Field,
    centre: Field,
    pitch: float,
    sd_mm: float,
    spread: Field,
) -> tuple[Field, Field]:
    shift = np.zeros(PRIOR_SD.size)
    inverse_prior = np.diag(PRIOR_SD**-2.0)
    covariance = np.diag(PRIOR_SD**2)
    tune = 6.0
    for step in range(25):
        moved = move(poses, shift, centre)
        hits = scene.cast(rays, moved)
        normal = scene.normals[hits.triangle]
        weight = smooth_weight(hits.depth_mm, normal, pitch)
        use = (weight > 0) & np.isfinite(depth)
        if use.sum() < 30:
            break
        residual = (depth - hits.depth_mm)[use] / spread[use]
        scale = max(1.4826 * np.median(np.abs(residual - np.median(residual))), sd_mm, 1e-5)
        if step < 3:
            scale = max(scale, 1.4826 * np.median(np.abs(residual)))
        tune = max(3.5, tune * 0.8)
        robust = (1 - np.clip(residual / (tune * scale), -1, 1) ** 2) ** 2
        columns = pose_columns(
            moved, rays, hits.depth_mm, normal, centre, travel_columns(moved)
        )[use]
        columns /= spread[use][:, None]
        factor = weight[use] * robust / scale**2
        normal_matrix = (columns * factor[:, None]).T @ columns
        # neighbours share noise: fifty readings count as one against the prior
        hessian = normal_matrix / 50 + inverse_prior
        gradient = (columns * factor[:, None]).T @ residual / 50 - inverse_prior @ shift
        change = np.linalg.solve(hessian, gradient)
        covariance = np.linalg.inv(hessian)
        largest = np.max(np.abs(change) / MOVE_LIMIT)
        shift = shift + change / max(largest, 1.0)
        if largest < 2e-6 and step > 6:
            break
    return shift, covariance


def _settle_by_edges(
    scene: Scene,
    rays: Laser,
    poses: Field,
    depth: Field,
    centre: Field,
    start: Field,
    covariance: Field,
    pitch: float,
    sd_mm: float,
    datasheet: Datasheet,
) -> Field:
    """Let silhouettes, if there are any, settle what smooth faces leave open.

    They do where the readings prefer one place clearly: first where the part lies, then how the
    sensor travels. At once, both ends of a bar would stretch the travel to make up for a part that
    lies elsewhere.
    """
    opened = [
        open_directions(covariance, poses, rays, depth, pitch, travels=travels)
        for travels in (False, True)
    ]
    if not len(opened[1]):
        return start
    hits = scene.cast(rays, moved := move(poses, start, centre))
    if not any_silhouette(hits.depth_mm, pitch):
        return start
    known = np.isfinite(depth)
    if datasheet.triangulation_angle_deg is not None:
        # what is read in a shadow is read elsewhere: it would draw the edge there
        seen = camera_visible(scene, rays, moved, hits, datasheet.camera_offset_mm)
        hidden = np.isfinite(hits.depth_mm) & ~seen
        known &= ~binary_dilation(hidden, iterations=SHADE)
    away = (depth - hits.depth_mm)[known & np.isfinite(hits.depth_mm)]
    # faces that are bent don't tell where they end
    cap = max(10 * sd_mm, STEP * pitch, 2 * mad_sd(away))

    def cost(shift: Field) -> float:
        hits = scene.cast(rays, move(poses, shift, centre))
        seen = np.isfinite(hits.depth_mm)
        both = known & seen
        gap = np.clip((depth - hits.depth_mm)[both] / cap, -1, 1)
        wrong = float((gap**2).sum() + (known & ~seen).sum())
        prior = float((shift / PRIOR_SD) @ (shift / PRIOR_SD))
        return wrong + 0.5 * prior

    for directions in opened:
        start = _searched(cost, start, directions, pitch)
    return start


def _searched(
    cost: Callable[[Field], float], start: Field, directions: Field, pitch: float
) -> Field:
    """Follow a piecewise cost along directions where that saves enough."""
    if not len(directions):
        return start

    def there(steps: Field) -> float:
        return cost(start + steps @ directions)

    best, gained = step_by_step(there, len(directions), [k * pitch for k in REACHES])
    if gained < LEAST_SETTLED:
        return start
    polished = minimize(
        there,
        best,
        method="Nelder-Mead",
        options={
            "initial_simplex": best
            + 0.05 * pitch * np.vstack([np.zeros(len(best)), np.eye(len(best))]),
            "maxfev": 30 * len(best),
            "xatol": 1e-3 * pitch,
            "fatol": 0.01,
        },
    )
    return np.asarray(start + polished.x @ directions)


def any_silhouette(depth_mm: Field, pitch_mm: float) -> bool:
    """Whether depth (n, m) ends, or leaves the line through its neighbours, anywhere."""
    bends = [np.abs(np.diff(depth_mm, n=2, axis=axis)) for axis in (0, 1)]
    steps = any((bend > STEP * pitch_mm).any() for bend in bends)
    return bool(steps or not np.isfinite(depth_mm).all())


def open_directions(
    covariance: Field,
    poses: Field,
    rays: Laser,
    depth_mm: Field,
    pitch_mm: float,
    *,
    travels: bool = True,
) -> Field:
    """Directions (k, 9) in which smooth faces leave a placement open; a unit moves it by 1 mm.

    Parameters
    ----------
    travels : whether the travel may be another; else where the part lies, for a travel as it is
    """
    sizes = np.array(
        [1.0, 1.0, 1.0, *(1 / _reach(poses, rays, depth_mm),) * 3, *(1 / _length(poses),) * 3]
    )
    if not travels:
        covariance, sizes = np.linalg.inv(np.linalg.inv(covariance)[:6, :6]), sizes[:6]
    values, vectors = np.linalg.eigh(covariance / np.outer(sizes, sizes))
    found = (vectors[:, np.sqrt(values) > OPEN * pitch_mm] * sizes[:, None]).T
    return np.hstack([found, np.zeros((len(found), 9 - len(sizes)))])


def overlap_fault(scene: Scene, rays: Laser, poses: Field, depth: Field) -> str:
    """Say why a recording and a part don't meet: elsewhere, or in other units."""
    hint = unit_hint(scene, rays, poses, depth, missed=True)
    if hint is not None:
        return hint
    seen = np.isfinite(depth)
    points = _points(poses, rays, depth)[seen]
    low, high = scene.vertices_mm.min(axis=0), scene.vertices_mm.max(axis=0)
    centre = np.round(points.mean(axis=0), 1)
    extent = f"{np.round(low, 1).tolist()} to {np.round(high, 1).tolist()}"
    return (
        f"doesn't overlap the part: readings centre on {centre.tolist()} mm in the part's frame, "
        f"the part spans {extent} mm (wrong pose, part or unit?)"
    )


def _subset(shape: tuple[int, ...]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    share = np.sqrt(max(shape[0] * shape[1] / SUBSET, 1.0))
    row_step = int(np.clip(np.ceil(share), 1, max(shape[0] // 40, 1)))
    column_step = int(np.clip(np.ceil(shape[0] * shape[1] / SUBSET / row_step), 1, shape[1] // 2))
    return np.arange(0, shape[0], row_step), np.arange(0, shape[1], column_step)


def _points(poses: Field, rays: Laser, depth_mm: Field) -> Field:
    local = rays.points_mm(depth_mm)
    turned = np.einsum("nij,nmj->nmi", poses[:, :3, :3], local)
    return np.asarray(turned + poses[:, None, :3, 3])


def pitch_of(points: Field, shape: tuple[int, ...]) -> float:
    """Distance of neighbouring readings, mm, where their points (k, 3) fill a scan that large."""
    spread = points.max(axis=0) - points.min(axis=0)
    return max(*(float(s) / max(shape) for s in spread), 1e-6)


def _reach(poses: Field, rays: Laser, depth: Field) -> float:
    points = _points(poses, rays, depth)[np.isfinite(depth)]
    spread = points.max(axis=0) - points.min(axis=0)
    return max(0.5 * float(np.sqrt((spread**2).sum())), 1e-3)


def _length(poses: Field) -> float:
    return float(max(np.linalg.norm(travel_vector(poses), axis=1).max(), 1e-3))


def _move_all(poses: Field, subset: Field, shift: Field, centre: Field) -> Field:
    """Apply a correction found on a subset of profiles: its travel counts from their mean."""
    still = np.zeros(6)
    moved = move(poses, np.concatenate([still, shift[6:]]), centre)
    behind = poses[:, :3, 3].mean(axis=0) - subset[:, :3, 3].mean(axis=0)
    moved[:, :3, 3] += (turned_ways(behind[None], poses) @ shift[6:])[0]
    return move(moved, np.concatenate([shift[:6], np.zeros(3)]), centre)


def hits_normal(scene: Scene, hits: Hits) -> Field:
    """Outward normals at the hits, part frame, (n, m, 3)."""
    return np.asarray(scene.normals[hits.triangle])
