"""What the maker of an instrument of the second family measures of its noise and states."""

from dataclasses import replace
from functools import partial

import numpy as np

from challenge.cases.nominal import NoiseLaw, noise_law
from challenge.instrument.instrument import Solid
from challenge.second.device import Device, Travel
from challenge.second.facets import Facets

WIDTHS, SHARE = 3.0, 0.6
"""Profiles of a tilted plate lie so many line widths apart, within this share of the range."""


def noise_on_plane(
    device: Device, slope_x: float, slope_y: float, profiles: int, rng: np.random.Generator
) -> float:
    """Measure the noise on one tilted plate, mm; readings beyond four deviations are left out."""
    way, distance = device.way, device.distance_mm
    nearing = abs(slope_y * way[1] - way[2])
    pitch = WIDTHS * device.slit.width_mm
    if nearing > 0:  # stay within the middle of the range
        pitch = min(pitch, SHARE * device.z_range_mm / nearing / profiles)
    start = np.eye(4)
    start[:3, 3] = -way * pitch * (profiles - 1) / 2
    travel = Travel(start=start, profiles=profiles, pitch_mm=pitch, rate_hz=100.0, start_s=0.0)
    x, y = np.array([-60.0, 60.0, -60.0, 60.0]), np.array([-60.0, -60.0, 60.0, 60.0])
    corners = np.stack([x, y, distance + slope_x * x + slope_y * y], 1)
    plane = Solid(vertices_mm=corners, faces=np.array([[0, 2, 1], [1, 2, 3]]))
    depth, _ = device.scan(plane, Facets(), travel, rng, specimen=int(rng.integers(2**31)))
    at = travel.travel_mm - travel.travel_mm.mean()
    across = distance + (slope_y * way[1] - way[2]) * at
    truth = across[:, None] + slope_x * device.camera.even_mm
    middle = abs(np.linspace(-1, 1, device.camera.columns)) < 0.5
    rest = (depth - truth)[:, middle]
    rest = rest - np.nanmedian(rest, 0)
    rest = rest[np.abs(rest) < 4 * 1.4826 * np.nanmedian(np.abs(rest))]
    return float(rest.std())


def measured_noise(device: Device, rng: np.random.Generator) -> NoiseLaw:
    """Fit the noise of a calibrated instrument over the tilts of plates."""
    still = replace(device, exposure_s=min(device.exposure_s, 2e-5))
    level = float(device.way[2] / device.way[1])
    return noise_law(partial(noise_on_plane, still, rng=rng), level)
