"""What the maker of an instrument states: its file, with what it always does as effects."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.optimize import lsq_linear

from challenge.cases.artefact import edge_figures
from challenge.cases.devices import Scans
from challenge.instrument.instrument import Instrument, Path, Solid
from challenge.instrument.optical_surface import OpticalSurface

_SLOPES = (-0.8, -0.6, -0.4, -0.2, 0.2, 0.4, 0.6, 0.8)
_COMMON = 0.35  # slopes up to about this are the common ones; steeper plates weigh less
_STATED = (0.0, -3.0), (4.0, 3.0)  # of exponent and lean: a file states no others


@dataclass(frozen=True, kw_only=True, slots=True)
class NoiseLaw:
    """The maker's fit ``σ = σ0 cos(β)^-exponent exp(lean dz/dy)``.

    Attributes
    ----------
    exponent, lean
        As listed.
    worst
        Largest error of σ at slopes up to 0.6, relative: two numbers do not follow it closer.
    """

    exponent: float
    lean: float
    worst: float


def _tilted(distance: float, slope_x: float, slope_y: float) -> Solid:
    """Plane through (0, 0, distance), in the sensor frame, facing the sensor."""
    x, y = np.array([-60.0, 60.0, -60.0, 60.0]), np.array([-60.0, -60.0, 60.0, 60.0])
    corners = np.stack([x, y, distance + slope_x * x + slope_y * y], 1)
    return Solid(vertices_mm=corners, faces=np.array([[0, 2, 1], [1, 2, 3]]))


def noise_on_plane(
    device: Instrument, slope_x: float, slope_y: float, profiles: int, rng: np.random.Generator
) -> float:
    """Measure the noise on one tilted plate, mm; readings beyond four deviations are left out."""
    distance = device.camera.working_distance_mm
    pitch = 3 * device.sheet.waist_mm
    if slope_y:  # stay within the middle of the range
        pitch = min(pitch, 0.6 * device.z_range_mm / abs(slope_y) / profiles)
    start = np.eye(4)
    start[1, 3] = -pitch * (profiles - 1) / 2
    path = Path(
        start=start, direction=1, profiles=profiles, pitch_mm=pitch, rate_hz=100.0, start_s=0.0
    )
    plane = _tilted(distance, slope_x, slope_y)
    depth, _ = device.scan(plane, OpticalSurface(), path, rng, specimen=int(rng.integers(2**31)))
    # tilts beyond the range's ends are cut off: keep the middle of the line
    middle = abs(np.linspace(-1, 1, device.camera.columns)) < 0.5
    y = start[1, 3] + pitch * np.arange(profiles)[:, None]
    truth = (distance + slope_y * y) / (1 - slope_x * np.tan(device.camera.angles_rad()))
    rest = (depth - truth)[:, middle]
    rest = rest - np.nanmedian(rest, 0)
    rest = rest[np.abs(rest) < 4 * 1.4826 * np.nanmedian(np.abs(rest))]
    return float(rest.std())


def noise_law(measured_mm: Callable[[float, float, int], float], level: float = 0.0) -> NoiseLaw:
    """Fit the noise on plates tilted along the line and along the travel, common slopes first.

    Reference plates give the level of flat ones to everybody, so the fit starts from there.

    Parameters
    ----------
    measured_mm
        Noise of a plate of slopes dz/dx and dz/dy in the sensor's frame, over so many profiles.
    level
        Slope dz/dy at which reference plates are seen.
    """
    flat = measured_mm(0.0, level, 150)
    slopes = np.array(_SLOPES)
    along = [measured_mm(s, level, 30) for s in _SLOPES]
    across = [measured_mm(0.0, level + s, 30) for s in _SLOPES]
    measured = np.log(np.concatenate([along, across]) / flat)
    # log σ / σ0 = exponent log(1 / cos β) + lean dz/dy, less the same of a level plate
    leaning = np.concatenate([0 * slopes, slopes])
    sideways = np.concatenate([slopes, 0 * slopes])
    steep = 0.5 * np.log((1 + sideways**2 + (level + leaning) ** 2) / (1 + level**2))
    design = np.stack([steep, leaning], 1)
    weight = 1 / (1 + (np.tile(slopes, 2) / _COMMON) ** 2)
    found = lsq_linear(design * weight[:, None], measured * weight, bounds=_STATED).x
    exponent, lean = round(float(found[0]), 3), round(float(found[1]), 3)
    rest = np.exp(measured - design @ np.array([exponent, lean])) - 1
    worst = float(np.abs(rest[np.abs(np.tile(slopes, 2)) < 0.7]).max())
    return NoiseLaw(exponent=exponent, lean=lean, worst=worst)


def usual_effects(
    device: Instrument, rng: np.random.Generator
) -> tuple[list[dict[str, Any]], NoiseLaw]:
    """List what the instrument always does, with the maker's own measurements.

    Parameters
    ----------
    device
        The well-made, calibrated instrument.
    """
    camera, sheet = device.camera, device.sheet
    noise, law = listed_noise(device, rng)
    grain = camera.amplitude_spread_mm(sheet.wavelength_mm) / np.sqrt(2)
    footprint = float(np.hypot(camera.column_pitch_mm / np.sqrt(12), grain))
    edges = edge_figures(_still(device), rng, along_um=1e3 * footprint)
    return [*edges.entries(device, 1e3 * footprint), noise], law


def listed_noise(
    device: Instrument, rng: np.random.Generator
) -> tuple[dict[str, Any], NoiseLaw]:
    """Return the file's entry of the noise on slopes, and the fit behind it."""
    law = noise_law(partial(noise_on_plane, _still(device), rng=rng))
    return {"name": "incidence_noise", "exponent": law.exponent, "lean": law.lean}, law


def _still(device: Instrument) -> Instrument:
    """Return the instrument on a perfect stage."""
    return replace(device, motion=type(device.motion)())


def repeatability_um(
    device: Instrument, solid: Solid, scans: Scans, rng: np.random.Generator
) -> float:
    """Electronic repeatability: two scans of the same surface without moving anything."""
    path = replace(scans.paths[0], profiles=20)
    pair = [device.scan(solid, OpticalSurface(), path, rng, specimen=1)[0] for _ in range(2)]
    rest = pair[0] - pair[1]
    return float(1e3 * 1.4826 * np.nanmedian(np.abs(rest - np.nanmedian(rest))) / np.sqrt(2))
