"""Simple targets for the virtual instrument and a straight scan over them."""

import numpy as np

from challenge.instrument.instrument import Path, Solid

DISTANCE = 150.0


def strip(z_of_x, *, half_x=15.0, half_y=60.0, points=3, slope_y=0.0, end_y=None):
    """Open strip ``z(x) + slope_y y`` facing the sensor."""
    x = np.linspace(-half_x, half_x, points)
    z = np.broadcast_to(z_of_x(x) if callable(z_of_x) else z_of_x, x.shape)
    far_y = half_y if end_y is None else end_y
    near = np.stack([x, np.full(points, -half_y), z - slope_y * half_y], 1)
    far = np.stack([x, np.full(points, far_y), z + slope_y * far_y], 1)
    i = np.arange(points - 1)
    faces = np.concatenate(
        [
            np.stack([i, i + points, i + 1], 1),
            np.stack([i + 1, i + points, i + points + 1], 1),
        ]
    )
    return Solid(vertices_mm=np.concatenate([near, far]), faces=faces)


def path(profiles, pitch_mm, *, start_y=0.0, rate_hz=100.0):
    """Straight scan along +y from ``start_y``."""
    start = np.eye(4)
    start[1, 3] = start_y
    return Path(
        start=start,
        direction=1,
        profiles=profiles,
        pitch_mm=pitch_mm,
        rate_hz=rate_hz,
        start_s=0.0,
    )
