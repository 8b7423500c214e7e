"""The laser fan: the ray of each point of a profile (formats: frames)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from files.errors import RecipeError
from sensors.datasheet import Datasheet
from sensors.recording import Recording


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Laser:
    """Rays of one profile in the sensor's x-z plane.

    Ray j starts at (x_mm[j], 0, 0) and runs along (slope_x[j], 0, 1): its parameter is the depth.

    Attributes
    ----------
    x_mm : (m,) float64
        Origins along the laser line, sensor frame, mm.
    slope_x : (m,) float64
        dx/dz of each ray, the tangent of its angle; increasing with j, or all 0.
    """

    x_mm: NDArray[np.float64]
    slope_x: NDArray[np.float64]

    @classmethod
    def from_datasheet(
        cls,
        datasheet: Datasheet,
        *,
        points: int | None = None,
        x_mm: NDArray[np.float64] | None = None,
    ) -> "Laser":
        """Build the rays of `datasheet`.

        even_angle: m rays from the emitter on the optical axis, evenly spaced in angle from -FOV/2
        to +FOV/2 (equation 2 of Sensors 2023, 23, 7624). even_x: m parallel rays, evenly spaced
        over x_fov, or at `x_mm` where a recording gives them.

        Raises
        ------
        RecipeError
            Where `x_mm` is given for a fan, or is not finite and strictly monotone.
        """
        count = datasheet.points_per_profile if points is None else points
        if datasheet.columns == "even_angle":
            if x_mm is not None:
                raise RecipeError("column positions /x go with 'columns: even_x' only")
            half = datasheet.fov_rad / 2
            return cls(
                x_mm=np.full(count, datasheet.optical_axis_x_mm),
                slope_x=np.tan(np.linspace(-half, half, count)),
            )
        if x_mm is None:
            half_mm = datasheet.x_fov_mm / 2
            x_mm = np.linspace(-half_mm, half_mm, count)
        x_mm = np.asarray(x_mm, dtype=np.float64)
        step = np.diff(x_mm)
        if not np.isfinite(x_mm).all() or not ((step > 0).all() or (step < 0).all()):
            raise RecipeError("column positions /x must be finite and strictly monotone")
        return cls(x_mm=x_mm, slope_x=np.zeros(x_mm.size))

    @classmethod
    def of_recording(cls, datasheet: Datasheet, recording: Recording) -> "Laser":
        """Return the rays that a recording states, else those of the datasheet."""
        if recording.ray_x_mm is not None and recording.ray_slope is not None:
            return cls(x_mm=recording.ray_x_mm, slope_x=recording.ray_slope)
        points = recording.depth_mm.shape[1]
        return cls.from_datasheet(datasheet, points=points, x_mm=recording.x_mm)

    @property
    def directions(self) -> NDArray[np.float64]:
        """Unit directions of the rays, (m, 3), sensor frame."""
        slope = self.slope_x
        direction = np.stack([slope, np.zeros_like(slope), np.ones_like(slope)], axis=-1)
        return np.asarray(direction / np.linalg.norm(direction, axis=-1, keepdims=True))

    def points_mm(self, depth_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Turn depths (..., m) into points (..., m, 3) in the sensor frame, mm."""
        return np.stack(
            [self.x_mm + depth_mm * self.slope_x, np.zeros_like(depth_mm), depth_mm], axis=-1
        )

    def points_part_mm(
        self, depth_mm: NDArray[np.float64], poses: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Turn depths (n, m) at poses (n, 4, 4) into points (n, m, 3) in the part frame, mm."""
        turned = self.points_mm(depth_mm) @ poses[:, :3, :3].transpose(0, 2, 1)
        return np.asarray(turned + poses[:, None, :3, 3])
