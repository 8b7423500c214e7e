"""Seconds for Perlin noise with four octaves on a full-size scan, one core."""

import time

import numpy as np

from sensors.noise.perlin import PerlinField
from sensors.surface.surface import Surface

PROFILES, POINTS = 2000, 4096
ROUNDS = 7


def median_seconds(field: PerlinField, rounds: int = ROUNDS) -> float:
    """Return the median time of drawing `field` on 2000 profiles of 4096 points.

    The pitch is the paper's (22.5 mm over 501 points, 22.5 mm over 100 profiles).
    """
    x_mm = np.arange(POINTS) * 22.5 / 501
    y_mm = np.arange(PROFILES) * 22.5 / 100
    field.sample(x_mm[:8], y_mm[:8], np.random.default_rng(0))  # compile
    seconds = []
    for seed in range(rounds):
        rng = np.random.default_rng(seed)
        start = time.perf_counter()
        field.sample(x_mm, y_mm, rng)
        seconds.append(time.perf_counter() - start)
    return float(np.median(seconds))


def fields() -> dict[str, PerlinField]:
    """Return what is timed, by name."""
    return {
        "four octaves, all shown by the grid": PerlinField(
            amplitude_mm=1.0, cell_x_mm=2.0, cell_y_mm=10.0, octaves=4
        ),
        "car door, verbatim, nothing left out": PerlinField(
            amplitude_mm=1.0, cell_x_mm=0.168, cell_y_mm=0.168, octaves=4, band_limited=False
        ),
        "car door, calibrated, height map": Surface.load("car_door").field(),
    }


def main() -> None:
    """Print a line for each field."""
    for name, field in fields().items():
        print(f"{name:<40} {median_seconds(field):6.3f} s")


if __name__ == "__main__":
    main()
