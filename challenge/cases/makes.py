"""Makes of instruments: what differs between those of one design, and what their files leave out.

The first family's instruments are of one make: well-made, and described by a maker who scanned an
artefact of edges with each. Of other makes line, lens, angle, finder, threshold and light are
others, profiles may be interpolated to even places, the stage isn't perfect, and the file has what
a datasheet has: nominal widths, and half of the optional keys.
"""

from dataclasses import dataclass
from math import atan, ceil, cos, hypot, radians, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray

from challenge.cases.devices import Z_RANGE_MM, draw_instrument
from challenge.cases.files import OPTIONAL
from challenge.cases.seeds import log_uniform
from challenge.instrument.calibration import CalibrationPlan
from challenge.instrument.camera import PUPIL, Camera
from challenge.instrument.frames import Faults
from challenge.instrument.instrument import Instrument
from challenge.instrument.motion import Motion
from challenge.instrument.peaks import KINDS, PeakFinder
from challenge.instrument.sheet import LaserSheet

Floats = NDArray[np.float64]
Readings = NDArray[np.float32]


@dataclass(frozen=True, kw_only=True, slots=True)
class Make:
    """An instrument, and what its maker delivers and states.

    Attributes
    ----------
    device
        Not yet calibrated.
    artefact
        Whether the maker scanned an artefact of edges and states what it showed; else the file
        has nominal figures.
    even_step
        Step between the even places to which readings are interpolated, of the step between rays
        at the working distance; None where columns are rays.
    left_out
        Keys that the file leaves out.
    """

    device: Instrument
    artefact: bool = True
    even_step: float | None = None
    left_out: tuple[str, ...] = ()

    def even_x_mm(self) -> Floats | None:
        """Even places (places,) along the line at the working distance; None for rays."""
        camera = self.device.camera
        if self.even_step is None:
            return None
        half = camera.working_distance_mm * np.tan(camera.fov_rad / 2)
        return np.linspace(-half, half, 1 + int((camera.columns - 1) / self.even_step))

    def delivered(self, depth_mm: Readings, bright: Readings) -> tuple[Readings, Readings]:
        """Bring depth and brightness (profiles, columns) to the places that the file states."""
        even = self.even_x_mm()
        if even is None:
            return depth_mm, bright
        ray = np.tan(self.device.camera.angles_rad())
        pairs = [
            _at_places(even, z * ray, z, b)
            for z, b in zip(depth_mm.astype(np.float64), bright.astype(np.float64), strict=True)
        ]
        depth, light = (np.stack(values).astype(np.float32) for values in zip(*pairs, strict=True))
        return depth, np.where(np.isfinite(depth), light, np.float32(0))

    def nominal_edges(self) -> list[dict[str, Any]]:
        """Return the file's laws of edges by nominal figures: the line's width and a pixel's."""
        camera, sheet = self.device.camera, self.device.sheet
        angle = round(float(np.degrees(camera.triangulation_rad)), 6)
        side = "+y" if camera.side > 0 else "-y"
        line = round(1e3 * sheet.waist_mm, 2)
        pixel = round(float(1e3 * camera.column_pitch_mm / np.sqrt(12)), 2)
        return [
            {"name": "camera_occlusion", "triangulation_angle_deg": angle, "camera_side": side,
             "line_sd_um": line},
            {"name": "finite_spot", "line_sd_um": line, "along_um": pixel},
            {"name": "edge_mixing", "line_sd_um": line},
        ]  # fmt: skip


def _at_places(even: Floats, x: Floats, z: Floats, bright: Floats) -> tuple[Floats, Floats]:
    """One profile's readings between the two beside each even place; NaN beside a missing one."""
    read = np.flatnonzero(np.isfinite(z))
    read = read[np.argsort(x[read], kind="stable")]
    nothing = np.full(even.size, np.nan)
    if read.size < 2:
        return nothing, np.zeros(even.size)
    pitch = max(even[1] - even[0], np.median(np.diff(x[read])))
    right = np.clip(np.searchsorted(x[read], even), 1, read.size - 1)
    a, b = read[right - 1], read[right]
    share = np.clip((even - x[a]) / np.maximum(x[b] - x[a], 1e-9), 0.0, 1.0)
    gap = np.maximum((1 - share > 0) * np.abs(even - x[a]), (share > 0) * np.abs(x[b] - even))
    depth = np.where(gap < 1.5 * pitch, z[a] * (1 - share) + z[b] * share, np.nan)
    return depth, bright[a] * (1 - share) + bright[b] * share


def first_make(rng: np.random.Generator) -> Make:
    """Draw an instrument of the first family."""
    return Make(device=draw_instrument(rng))


def other_make(rng: np.random.Generator) -> Make:
    """Draw an instrument of any make, in good order."""
    distance, theta = float(rng.uniform(90, 220)), radians(rng.uniform(18, 34))
    columns, pitch = int(rng.integers(160, 257)), float(rng.uniform(0.08, 0.13))
    waist = log_uniform(rng, 0.028, 0.085)
    wavelength = float(rng.choice([405e-6, 450e-6, 520e-6, 660e-6]))
    sin_u = log_uniform(rng, 0.004, 0.0085)
    grain = PUPIL * wavelength / sin_u / np.sqrt(2)
    # a line is at least three quarters of a pixel wide (sd), or the finder locks to the rows
    row = hypot(waist * cos(theta), grain) / float(rng.uniform(0.75, 1.5))
    rows = int(8 * ceil(1.25 * Z_RANGE_MM * sin(theta) / row / 8))
    camera = Camera(
        working_distance_mm=distance, triangulation_rad=theta, side=int(rng.choice([-1, 1])),
        columns=columns, fov_rad=2 * atan((columns - 1) * pitch / 2 / distance), rows=rows,
        row_pitch_mm=row, sin_u=sin_u, smile=float(rng.uniform(-4, 4)),
        keystone=float(rng.uniform(-1, 1)), barrel=float(rng.uniform(-1.5, 1.5)),
        fill=float(rng.uniform(0.2, 0.6)), bits=int(rng.choice([8, 10, 12])),
        read_noise_e=log_uniform(rng, 5, 25),
    )  # fmt: skip
    rays = rng.integers(3) == 0
    left_out = tuple(key for key in OPTIONAL if rng.random() < 0.5)
    device = Instrument(
        sheet=LaserSheet(
            waist_mm=waist, waist_z_mm=distance + float(rng.uniform(-3, 3)),
            wavelength_mm=wavelength, m_squared=float(rng.uniform(1.1, 1.6)), exposure_s=5e-5,
        ),
        camera=camera,
        finder=PeakFinder(kind=str(rng.choice(KINDS)), threshold=log_uniform(rng, 0.012, 0.06),
                          fraction_bits=int(rng.choice([5, 6, 8]))),
        # the line's light falls off towards its ends
        faults=Faults(window_dip=float(rng.uniform(-0.5, 0.0)), window_width=0.6),
        motion=Motion(shake_mm=log_uniform(rng, 5e-5, 5e-4), shake_hz=float(rng.uniform(5, 60)),
                      ripple_mm=log_uniform(rng, 2e-4, 2e-3),
                      ripple_period_mm=float(rng.uniform(2, 8))),
        plan=CalibrationPlan(heights=21, frames=16),
        z_range_mm=Z_RANGE_MM,
        step_mm=float(rng.choice([0.00025, 0.001, 0.004])),
    )  # fmt: skip
    # the rays' own step would put each place near the working distance on a ray
    even_step = None if rays else log_uniform(rng, 0.7, 1.5)
    return Make(device=device, artefact=False, even_step=even_step, left_out=left_out)
