"""What the maker of an instrument states: its file, with what it always does as effects."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from challenge.cases.devices import Scans
from challenge.instrument.finish import Finish
from challenge.instrument.instrument import Instrument, Path, Solid

_SLOPES = (-0.9, -0.6, -0.3, 0.0, 0.3, 0.6, 0.9)


def _tilted(distance: float, slope_x: float, slope_y: float) -> Solid:
    """Plane through (0, 0, distance), in the sensor frame, facing the sensor."""
    x, y = np.array([-60.0, 60.0, -60.0, 60.0]), np.array([-60.0, -60.0, 60.0, 60.0])
    corners = np.stack([x, y, distance + slope_x * x + slope_y * y], 1)
    return Solid(vertices_mm=corners, faces=np.array([[0, 2, 1], [1, 2, 3]]))


def noise_against_slope(
    device: Instrument, rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Measure the noise on plates tilted along the line and along the travel.

    Returns
    -------
    along, across : (7,) mm
        Standard deviation at slopes -0.9 to 0.9 of dz/dx and of dz/dy.
    """
    distance = device.camera.working_distance_mm
    path = Path(
        start=np.eye(4), direction=1, profiles=30, pitch_mm=8 * device.sheet.waist_mm,
        rate_hz=100.0, start_s=0.0,
    )  # fmt: skip
    # tilts beyond the range's ends are cut off: keep the middle of the line
    middle = abs(np.linspace(-1, 1, device.camera.columns)) < 0.5
    found = np.zeros((2, len(_SLOPES)))
    for axis in range(2):
        for k, slope in enumerate(_SLOPES):
            plane = _tilted(distance, *((slope, 0.0) if axis == 0 else (0.0, slope)))
            depth, _ = device.scan(plane, Finish(), path, rng, specimen=int(rng.integers(2**31)))
            y = path.pitch_mm * np.arange(path.profiles)
            tan_a = np.tan(device.camera.angles_rad())
            if axis == 0:
                truth = np.broadcast_to(distance / (1 - slope * tan_a), depth.shape)
            else:
                truth = np.broadcast_to((distance + slope * y)[:, None], depth.shape)
            rest = (depth - truth)[:, middle]
            found[axis, k] = 1.4826 * np.nanmedian(np.abs(rest - np.nanmedian(rest)))
    return found[0], found[1]


def usual_effects(device: Instrument, rng: np.random.Generator) -> list[dict[str, Any]]:
    """List what the instrument always does, with the maker's own measurements.

    Parameters
    ----------
    device
        The well-made, calibrated instrument.
    """
    camera, sheet = device.camera, device.sheet
    still = replace(device, motion=type(device.motion)())
    along, across = noise_against_slope(still, rng)
    slopes = np.array(_SLOPES)
    steep = np.log(np.hypot(1, slopes))
    # log σ = constant + exponent log(1 / cos β) + lean dz/dy, over both sets of plates
    design = np.stack(
        [np.ones(2 * slopes.size), np.tile(steep, 2), np.concatenate([0 * slopes, slopes])], 1
    )
    measured = np.log(np.concatenate([along, across]))
    exponent, lean = (float(v) for v in np.linalg.lstsq(design, measured, rcond=None)[0][1:])
    exponent = max(exponent, 0.0)
    grain = camera.amplitude_spread_mm(sheet.wavelength_mm) / np.sqrt(2)
    footprint = float(np.hypot(camera.column_pitch_mm / np.sqrt(12), grain))
    line_sd_um = round(1e3 * sheet.waist_mm, 3)
    rayleigh = round(sheet.rayleigh_mm, 2)
    # two images merge while their runs above the threshold touch
    seen = np.hypot(sheet.waist_mm * np.cos(camera.triangulation_rad), grain)
    touch = 2 * seen * np.sqrt(2 * np.log(camera.fill / device.finder.threshold))
    merge = 1e3 * touch / np.sin(camera.triangulation_rad)
    if device.finder.kind == "gravity_all":
        merge = 1e3 * device.z_range_mm
    return [
        {
            "name": "camera_occlusion",
            "triangulation_angle_deg": round(float(np.degrees(camera.triangulation_rad)), 6),
            "camera_side": "+y" if camera.side > 0 else "-y",
        },
        {
            "name": "finite_spot",
            "line_sd_um": line_sd_um,
            "along_um": round(1e3 * footprint, 2),
            "rayleigh_mm": rayleigh,
        },
        {
            "name": "edge_mixing",
            "line_sd_um": line_sd_um,
            "merge_um": round(float(merge), 1),
            "rayleigh_mm": rayleigh,
        },
        {"name": "incidence_noise", "exponent": round(exponent, 3), "lean": round(lean, 3)},
    ]


def repeatability_um(
    device: Instrument, solid: Solid, scans: Scans, rng: np.random.Generator
) -> float:
    """Electronic repeatability: two scans of the same surface without moving anything."""
    path = replace(scans.paths[0], profiles=20)
    pair = [device.scan(solid, Finish(), path, rng, specimen=1)[0] for _ in range(2)]
    rest = pair[0] - pair[1]
    return float(1e3 * 1.4826 * np.nanmedian(np.abs(rest - np.nanmedian(rest))) / np.sqrt(2))
