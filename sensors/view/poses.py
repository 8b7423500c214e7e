"""Poses of a scan: points and vectors moved by them, path length along them, displacement."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def to_part(poses: Floats, points_mm: Floats) -> Floats:
    """Move points (n, ..., 3) of the sensor frames into the part frame by poses (n, 4, 4), mm."""
    origin = poses[:, :3, 3].reshape(-1, *([1] * (points_mm.ndim - 2)), 3)
    return turn_to_part(poses, points_mm) + origin


def turn_to_part(poses: Floats, vectors: Floats) -> Floats:
    """Turn vectors (n, ..., 3) of the sensor frames into the part frame by poses (n, 4, 4)."""
    flat = vectors.reshape(len(vectors), -1, 3)
    return (flat @ poses[:, :3, :3].transpose(0, 2, 1)).reshape(vectors.shape)


def displaced(poses: Floats, shift_mm: Floats) -> Floats:
    """Return poses (n, 4, 4) of a sensor displaced by (n, 3) mm along its own axes."""
    moved = poses.copy()
    moved[:, :3, 3] += np.einsum("nij,nj->ni", moved[:, :3, :3], shift_mm)
    return moved


def travelled_mm(poses: Floats) -> Floats:
    """Path length from the first pose, (n,) mm, counted positive where the sensor moves to +y."""
    step = np.diff(poses[:, :3, 3], axis=0)
    forward = np.einsum("ij,ij->i", step, poses[:-1, :3, 1]) >= 0
    length = np.where(forward, 1.0, -1.0) * np.linalg.norm(step, axis=1)
    return np.concatenate([[0.0], np.cumsum(length)])


def travel_steps_mm(poses: Floats) -> Floats:
    """Signed path length from each pose to the next, (n,) mm; the last repeats the one before."""
    if len(poses) < 2:
        return np.zeros(len(poses))
    step = np.diff(travelled_mm(poses))
    return np.concatenate([step, step[-1:]])
