"""Draw an instrument and the scans of a case: every case has its own, effects or not."""

from dataclasses import dataclass
from math import atan, radians

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from challenge.cases.seeds import log_uniform
from challenge.instrument.calibration import CalibrationPlan
from challenge.instrument.camera import Camera
from challenge.instrument.frames import Faults
from challenge.instrument.instrument import Instrument, Path
from challenge.instrument.motion import Motion
from challenge.instrument.peaks import PeakFinder
from challenge.instrument.sheet import LaserSheet

Z_RANGE_MM = 12.0
_TURNS_DEG = (0.0, 180.0, 90.0)


@dataclass(frozen=True, kw_only=True, slots=True)
class Scans:
    """The commanded scans of a case and where the part truly lay in each.

    Attributes
    ----------
    paths : tuple of Path
    misplaced : tuple of (4, 4)
        Rigid errors of the part's place, part -> part.
    """

    paths: tuple[Path, ...]
    misplaced: tuple[NDArray[np.float64], ...]


def draw_instrument(rng: np.random.Generator) -> Instrument:
    """Draw an instrument of an ordinary, well-made kind."""
    distance = float(rng.uniform(110, 200))
    # beyond about 28 degrees the noise on slopes leaves the two-number law a maker can list
    theta = radians(rng.uniform(22, 28))
    columns = int(rng.integers(200, 257))
    column_pitch = float(rng.uniform(0.085, 0.115))
    waist = float(rng.uniform(0.038, 0.058))
    row_pitch = float(rng.uniform(0.8, 1.1) * waist * np.cos(theta))
    rows = int(8 * np.ceil(1.25 * Z_RANGE_MM * np.tan(theta) / np.hypot(1, np.tan(theta))
                           / row_pitch / 8))  # fmt: skip
    camera = Camera(
        working_distance_mm=distance,
        triangulation_rad=theta,
        side=int(rng.choice([-1, 1])),
        columns=columns,
        fov_rad=2 * atan((columns - 1) * column_pitch / 2 / distance),
        rows=rows,
        row_pitch_mm=row_pitch,
        sin_u=float(rng.uniform(0.0045, 0.0065)),
        smile=float(rng.uniform(-2, 2)),
        keystone=float(rng.uniform(-0.5, 0.5)),
        barrel=float(rng.uniform(-0.8, 0.8)),
        fill=float(rng.uniform(0.25, 0.35)),
        bits=int(rng.choice([8, 10])),
        read_noise_e=float(rng.uniform(8, 16)),
    )
    return Instrument(
        sheet=LaserSheet(
            waist_mm=waist,
            waist_z_mm=distance,
            wavelength_mm=float(rng.choice([405e-6, 450e-6])),
            exposure_s=5e-5,
        ),
        camera=camera,
        finder=PeakFinder(
            kind=str(rng.choice(["gravity", "gravity_all"])), threshold=0.015, fraction_bits=6
        ),
        faults=Faults(),
        motion=Motion(),
        plan=CalibrationPlan(heights=21, frames=16),
        z_range_mm=Z_RANGE_MM,
        step_mm=float(rng.choice([0.001, 0.002])),
    )


def draw_scans(
    rng: np.random.Generator, device: Instrument, *, count: int = 3, top_mm: float = 2.0,
    aligned: bool = False,
) -> Scans:  # fmt: skip
    """Draw the poses of a case's recordings: turned and tilted differently.

    Parameters
    ----------
    count
        Recordings.
    top_mm
        Height in the part's frame that stands at the working distance.
    aligned
        The part's length lies along the line, as against a stop.
    """
    pitch = float(rng.uniform(0.085, 0.115))
    # slow stages and fast ones: nothing about a case may be read from its speed
    rate = log_uniform(rng, *((2.0, 5.0) if rng.random() < 0.4 else (100.0, 500.0)))
    profiles = int(rng.integers(140, 181))
    turns = rng.permutation(_TURNS_DEG)[:count] + rng.uniform(-15, 15, count)
    if aligned:
        turns = 180.0 * np.round(turns / 180.0)
    way = _Way(pitch_mm=pitch, rate_hz=rate, profiles=profiles, top_mm=top_mm)
    return _scans_at(rng, device, turns, way, float(rng.uniform(5, 60)))


def draw_earlier_scans(
    rng: np.random.Generator, device: Instrument, later: Path, *, count: int, top_mm: float
) -> Scans:
    """Draw recordings of a good part, made before a case's: of its pitch, rate and length.

    Parameters
    ----------
    later
        A scan of the case.
    count, top_mm
        As of `draw_scans`.
    """
    turns = rng.permutation(_TURNS_DEG)[:count] + rng.uniform(-15, 15, count)
    way = _Way(pitch_mm=later.pitch_mm, rate_hz=later.rate_hz, profiles=later.profiles,
               top_mm=top_mm)  # fmt: skip
    return _scans_at(rng, device, turns, way, 0.0)


@dataclass(frozen=True, kw_only=True, slots=True)
class _Way:
    """What all scans of a case have in common; `top_mm` stands at the working distance."""

    pitch_mm: float
    rate_hz: float
    profiles: int
    top_mm: float


def _scans_at(
    rng: np.random.Generator, device: Instrument, turns_deg: NDArray[np.float64], way: _Way,
    clock_s: float,
) -> Scans:  # fmt: skip
    """Draw the rest of each scan: its lean, its aim, its direction and where the part lies."""
    paths, misplaced = [], []
    for turned in turns_deg:
        face = Rotation.from_euler("x", 180, degrees=True)  # sensor z looks down the part's z
        spin = Rotation.from_euler("z", turned, degrees=True)
        lean = Rotation.from_euler("xy", rng.uniform(-9, 9, 2), degrees=True)
        turn = (spin * lean * face).as_matrix()
        aim = np.array([*rng.uniform(-2.0, 2.0, 2), way.top_mm / 2 + rng.uniform(-0.5, 0.5)])
        direction = int(rng.choice([-1, 1]))
        middle = direction * way.pitch_mm * (way.profiles - 1) / 2
        start = np.eye(4)
        start[:3, :3] = turn
        start[:3, 3] = aim - turn @ np.array([0.0, middle, device.camera.working_distance_mm])
        paths.append(
            Path(
                start=start,
                direction=direction,
                profiles=way.profiles,
                pitch_mm=way.pitch_mm,
                rate_hz=way.rate_hz,
                start_s=round(clock_s, 3),
            )
        )
        clock_s += way.profiles / way.rate_hz + float(rng.uniform(20, 200))
        error = np.eye(4)
        error[:3, :3] = Rotation.from_rotvec(rng.normal(0, radians(0.02), 3)).as_matrix()
        error[:3, 3] = rng.normal(0, 0.03, 3)
        misplaced.append(error)
    return Scans(paths=tuple(paths), misplaced=tuple(misplaced))
