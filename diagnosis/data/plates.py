"""Reference plates: residuals of a scan of something flat against its best plane."""

from dataclasses import dataclass

import numpy as np

from diagnosis.data.patch import in_range
from diagnosis.fields import Field, median_sd
from diagnosis.settings import SETTINGS
from files.errors import RecipeError
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet
from sensors.model import SensorModel
from sensors.recording import Recording, repeated_rows
from sensors.view.view import View


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Plate:
    """Residual of a plate's readings, (n, m) mm, NaN where missing or off the plate.

    Attributes
    ----------
    view : the scan of an endless plane where the plate lay; a sensor may look at it askew
    """

    residual_mm: Field
    view: View
    missing_share: float
    pitch_mm: tuple[float, float]


def plate_residual(recording: Recording, datasheet: Datasheet) -> Plate:
    """Fit a plane to a scan of a plate, robustly, and take it off along the rays.

    Raises
    ------
    RecipeError
        Where most of the scan doesn't lie on a plane.
    """
    depth = in_range(recording.depth_mm, datasheet)
    depth[repeated_rows(recording.depth_mm)] = np.nan
    laser = Laser.of_recording(datasheet, recording)
    poses = recording.poses
    local = laser.points_mm(depth)
    points = np.einsum("nij,nmj->nmi", poses[:, :3, :3], local) + poses[:, None, :3, 3]
    known = np.isfinite(depth)
    if known.sum() < SETTINGS.data.plate_readings:
        raise RecipeError("a reference plate needs readings", where=recording.name)
    cloud = points[known]
    weight = np.ones(len(cloud))
    for _ in range(12):
        centre = np.average(cloud, axis=0, weights=weight)
        _, _, axes = np.linalg.svd(
            (cloud - centre)[:: max(1, len(cloud) // 20000)]
            * np.sqrt(weight[:: max(1, len(cloud) // 20000), None]),
            full_matrices=False,
        )
        normal = axes[2]
        away = (cloud - centre) @ normal
        scale = max(median_sd(away), 1e-6)
        weight = (np.abs(away) < SETTINGS.clip * scale) * 1.0 + 1e-9
    if scale > SETTINGS.data.plate_flat_mm:
        raise RecipeError(
            "a reference should be a flat plate", where=recording.name, value=f"{scale:.2g} mm off"
        )
    axis = poses[:, None, :3, 2] + laser.slope_x[None, :, None] * poses[:, None, :3, 0]
    origin = poses[:, None, :3, 3] + laser.x_mm[None, :, None] * poses[:, None, :3, 0]
    expected = ((centre - origin) @ normal) / (axis @ normal)
    residual = depth - expected
    on_plate = known & (np.abs(residual) < SETTINGS.data.plate_sd * scale)
    rows, columns = np.nonzero(on_plate)
    box = (slice(rows.min(), rows.max() + 1), slice(columns.min(), columns.max() + 1))
    step = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    x = laser.x_mm + datasheet.working_distance_mm * laser.slope_x
    towards = poses[:, :3, 3].mean(axis=0) - centre
    plane = _plane(centre, axes, 2 * float(np.ptp(cloud, axis=0).max()), towards)
    return Plate(
        residual_mm=np.where(on_plate, residual, np.nan),
        view=View(plane, SensorModel(datasheet), poses, recording.time_s, laser=laser),
        missing_share=float(1 - known[box].mean()),
        pitch_mm=(float(np.median(np.abs(np.diff(x)))), float(np.median(step))),
    )


def _plane(centre: Field, axes: Field, reach_mm: float, towards: Field) -> Scene:
    """Two triangles about a centre along the first two axes, wider than all that was scanned.

    Parameters
    ----------
    towards : direction of the side that is outside
    """
    corners = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    if np.cross(axes[0], axes[1]) @ towards < 0:
        corners = corners[::-1]
    return Scene(centre + reach_mm * corners @ axes[:2], np.array([[0, 1, 2], [0, 2, 3]]))
