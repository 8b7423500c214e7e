"""The sample of a recording's readings that registration goes by, and where it meets the part."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from diagnosis.fields import Field, Mask
from diagnosis.register.part_unit import unit_hint
from diagnosis.settings import SETTINGS
from files.errors import RecipeError
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.recording import Recording

READINGS = 120_000
"""Readings of a sample, about: whole rows and columns, evenly spread."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Sample:
    """Readings of some profiles and columns of a recording.

    Attributes
    ----------
    poses : (n, 4, 4) float64
        Commanded.
    depth_mm : (n, m) float64
        Readings less what a model expects beyond the geometric depth; NaN where not used.
    spread : (n, m) float64
        What each reading's noise is larger or smaller by.
    """

    scene: Scene
    rays: Laser
    poses: Field
    depth_mm: Field
    spread: Field

    @classmethod
    def of(
        cls,
        scene: Scene,
        recording: Recording,
        laser: Laser,
        *,
        valid: Mask,
        offset_mm: Field | None = None,
        spread: Field | None = None,
    ) -> "Sample":
        """Take a sample of a recording; offset and spread (n, m) as in `register`."""
        rows, columns = _spread_out(recording.depth_mm.shape)
        pick = np.ix_(rows, columns)
        depth = np.where(valid[pick], recording.depth_mm[pick], np.nan)
        if offset_mm is not None:
            depth = depth - np.nan_to_num(offset_mm[pick])
        return cls(
            scene=scene,
            rays=Laser(x_mm=laser.x_mm[columns], slope_x=laser.slope_x[columns]),
            poses=recording.poses[rows],
            depth_mm=depth,
            spread=np.ones(depth.shape) if spread is None else spread[pick],
        )

    def met(self, name: str) -> tuple[Field, Mask]:
        """Points (k, 3) of the part that rays with a reading meet, and which rays (n, m) these are.

        Raises
        ------
        RecipeError
            Where there are too few; with the recording's name.
        """
        first = self.scene.cast(self.rays, self.poses)
        read = np.isfinite(self.depth_mm)
        together = np.isfinite(first.depth_mm) & read
        least = max(SETTINGS.register.least_met, SETTINGS.register.least_share_met * read.sum())
        if together.sum() < least:
            raise RecipeError(self._fault(), where=name)
        return self.rays.points_part_mm(first.depth_mm, self.poses)[together], together

    def _fault(self) -> str:
        """Say why the readings and the part don't meet: elsewhere, or in other units."""
        hint = unit_hint(self.scene, self.rays, self.poses, self.depth_mm, missed=True)
        if hint is not None:
            return hint
        points = self.rays.points_part_mm(self.depth_mm, self.poses)[np.isfinite(self.depth_mm)]
        vertices = self.scene.vertices_mm
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        centre = np.round(points.mean(axis=0), 1)
        extent = f"{np.round(low, 1).tolist()} to {np.round(high, 1).tolist()}"
        return (
            f"doesn't overlap the part: readings centre on {centre.tolist()} mm in the part's "
            f"frame, the part spans {extent} mm (wrong pose, part or unit?)"
        )


def check_meets(scene: Scene, recording: Recording, laser: Laser, *, valid: Mask) -> None:
    """Refuse a recording that misses the part from its commanded poses.

    Raises
    ------
    RecipeError
        Where too few of its rays meet the part, or it would fit in another unit.
    """
    sample = Sample.of(scene, recording, laser, valid=valid)
    sample.met(recording.name)
    hint = unit_hint(scene, sample.rays, sample.poses, sample.depth_mm)
    if hint is not None:
        raise RecipeError(hint, where=recording.name)


def pitch_of(points: Field, shape: tuple[int, ...]) -> float:
    """Distance of neighbouring readings, mm, where their points (k, 3) fill a scan that large."""
    spread = points.max(axis=0) - points.min(axis=0)
    return max(*(float(s) / max(shape) for s in spread), 1e-6)


def _spread_out(shape: tuple[int, ...]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    share = np.sqrt(max(shape[0] * shape[1] / READINGS, 1.0))
    row_step = int(np.clip(np.ceil(share), 1, max(shape[0] // 40, 1)))
    column_step = int(np.clip(np.ceil(shape[0] * shape[1] / READINGS / row_step), 1, shape[1] // 2))
    return np.arange(0, shape[0], row_step), np.arange(0, shape[1], column_step)
