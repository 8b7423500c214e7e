"""An instrument of a case: its true datasheet, what its file leaves out, and its scans."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from files.plain_data import plain
from sensors.datasheet import Datasheet

Floats = NDArray[np.float64]
PROFILES, POINTS = 120, 180
PITCH_MM = 0.3
MISPLACED_RAD, MISPLACED_MM = 4e-4, 0.04
"""How a part lies off by chance, standard deviation about and along each axis."""
OPTIONAL = (
    "repeatability_um", "triangulation_angle_deg", "camera_side", "line_width_um",
    "wavelength_nm", "exposure_s", "camera_rows",
)  # fmt: skip
"""Keys that real makers' files often leave out; each case's leaves out half of them."""
SPECKLE_SHARE = 0.85
"""Share of the noise's variance that is speckle; the rest is independent."""
MISSING_SHARE = 5e-4
"""Readings that go missing for no reason, in good instruments too."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Scan:
    """One scan: commanded poses, the rigid error of the part's place, its clock."""

    poses: Floats
    error: Floats
    time_s: Floats
    start_s: float

    @property
    def true_poses(self) -> Floats:
        """Where the sensor is over the part, sensor -> part, (n, 4, 4)."""
        return np.asarray(self.error @ self.poses)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Instrument:
    """What a case's recordings are taken with.

    Attributes
    ----------
    sheet : the truth
    left_out : keys that the file doesn't state
    noise_mm : standard deviation of a reading on a plane
    wobble : small smooth error of good instruments over (x, z), Legendre coefficients in mm
    """

    sheet: Datasheet
    left_out: tuple[str, ...]
    noise_mm: float
    wobble: Floats

    def stated(self, effects: tuple[dict[str, Any], ...] = ()) -> dict[str, Any]:
        """Return the file that a stranger gets."""
        known = dict(plain(replace(self.sheet, effects=effects)))
        return {key: value for key, value in known.items() if key not in self.left_out}

    def scans(self, rng: np.random.Generator, count: int) -> list[Scan]:
        """Draw scans over the part's middle, turned, tilted and shifted differently."""
        turns = np.resize([0.0, 90.0, 180.0, 270.0], count) + rng.uniform(-15, 15, count)
        clock, out = float(rng.uniform(5, 60)), []
        for turn in turns:
            face = Rotation.from_euler("x", 180, degrees=True)
            spin = Rotation.from_euler("z", turn, degrees=True)
            lean = Rotation.from_euler("xy", rng.uniform(-9, 9, 2), degrees=True)
            pose = np.tile(np.eye(4), (PROFILES, 1, 1))
            pose[:, :3, :3] = (spin * lean * face).as_matrix()
            along = (np.arange(PROFILES) - (PROFILES - 1) / 2) * PITCH_MM * rng.choice([-1.0, 1.0])
            aim = np.array([*rng.uniform(-2, 2, 2), 1.0 + rng.uniform(-2, 2)])
            away = -self.sheet.working_distance_mm * pose[0, :3, 2]
            pose[:, :3, 3] = aim + away + along[:, None] * pose[0, :3, 1]
            error = np.eye(4)
            error[:3, :3] = Rotation.from_rotvec(rng.normal(0, MISPLACED_RAD, 3)).as_matrix()
            error[:3, 3] = rng.normal(0, MISPLACED_MM, 3)
            time = np.arange(PROFILES) / self.sheet.profile_rate_hz
            out.append(Scan(poses=pose, error=error, time_s=time, start_s=round(clock, 3)))
            clock += float(time[-1]) + float(rng.uniform(20, 120))
        return out


def draw_instrument(rng: np.random.Generator, *, slow: bool = False) -> Instrument:
    """Draw a well-made instrument; a slow one takes minutes for a recording."""
    distance, rate = float(rng.uniform(90, 160)), 1.0 if slow else float(rng.uniform(100, 400))
    sheet = Datasheet(
        name="bench",
        working_distance_mm=round(distance, 2),
        z_range_mm=40.0,
        x_fov_mm=round(float(rng.uniform(38, 44)), 2),
        points_per_profile=POINTS,
        z_resolution_um=float(rng.choice([0.5, 1.0, 2.0])),
        repeatability_um=2.0,
        profile_rate_hz=round(rate, 2),
        travel_speed_mm_s=round(rate * PITCH_MM, 3),
        columns=str(rng.choice(["even_angle", "even_x"])),
        triangulation_angle_deg=round(float(rng.uniform(22, 36)), 2),
        camera_side=str(rng.choice(["+y", "-y"])),
        line_width_um=round(float(rng.uniform(90, 180)), 1),
        wavelength_nm=405.0,
        exposure_s=1e-4,
        camera_rows=int(rng.choice([256, 512, 1024])),
    )
    dropped = rng.permutation(OPTIONAL)[: len(OPTIONAL) // 2 + int(rng.integers(2))]
    noise = float(rng.uniform(0.006, 0.014))
    return Instrument(
        sheet=sheet, left_out=tuple(sorted(map(str, dropped))), noise_mm=noise,
        wobble=noise * rng.normal(0, 0.015, (4, 3)),
    )  # fmt: skip
