"""The stage and the mounting: where the sensor truly is while the poses say otherwise."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation


@dataclass(frozen=True, kw_only=True, slots=True)
class Motion:
    """Departures of the true motion from the commanded one.

    Attributes
    ----------
    shake_mm, shake_hz
        Amplitude of the stage's vibration along the sensor's z, and its frequency.
    ripple_mm, ripple_period_mm
        Amplitude and period of the position error along the travel (lead screw).
    warm_mm, warm_s
        How far the head moves along z while it warms up, and its time constant, on the clock
        that counts from switching the instrument on.
    lost_counts_mm, lost_at
        Travel missed by the encoder, and after which shares of the path.
    roll_rad, pitch_rad, yaw_rad, mount_mm
        Mounting: true orientation and position of the head relative to what the poses say;
        rotations about y, x, z of the sensor frame.
    """

    shake_mm: float = 0.0
    shake_hz: float = 0.0
    ripple_mm: float = 0.0
    ripple_period_mm: float = 5.0
    warm_mm: float = 0.0
    warm_s: float = 300.0
    lost_counts_mm: float = 0.0
    lost_at: tuple[float, ...] = ()
    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    yaw_rad: float = 0.0
    mount_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def mounting(self) -> NDArray[np.float64]:
        """Pose (4, 4) of the true sensor frame in the frame that the poses speak of."""
        pose = np.eye(4)
        pose[:3, :3] = Rotation.from_euler(
            "yxz", [self.roll_rad, self.pitch_rad, self.yaw_rad]
        ).as_matrix()
        pose[:3, 3] = self.mount_mm
        return pose

    def where(
        self,
        time_s: NDArray[np.float64],
        travelled_mm: NDArray[np.float64],
        *,
        direction: float,
        start_s: float,
        phases_rad: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Follow the true position of the sensor along the path.

        Parameters
        ----------
        time_s : (n, k)
            Instants of the exposures, seconds since the first profile.
        travelled_mm : (n, k)
            Commanded distance from the path's start, positive.
        direction : float
            +1 when the sensor travels along its own +y, else -1.
        start_s : float
            The first profile on the instrument's clock.
        phases_rad : (2,)
            Phase of the vibration and of the ripple.

        Returns
        -------
        (n, k, 3) : x, y, z in mm, in the sensor frame at the path's start
        """
        place = np.zeros((*time_s.shape, 3))
        travel = travelled_mm + self.ripple_mm * np.sin(
            2 * np.pi * travelled_mm / self.ripple_period_mm + phases_rad[1]
        )
        length = float(travelled_mm.max()) if travelled_mm.size else 0.0
        for share in self.lost_at:
            travel = travel + self.lost_counts_mm * (travelled_mm > share * length)
        place[..., 1] = direction * travel
        place[..., 2] = self.shake_mm * np.sin(2 * np.pi * self.shake_hz * time_s + phases_rad[0])
        if self.warm_mm != 0:
            place[..., 2] += self.warm_mm * (1 - np.exp(-(start_s + time_s) / self.warm_s))
        return place
