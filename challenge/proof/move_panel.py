"""Where the sensor stands against where its poses say, drawn in one plane."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from challenge.proof.story import Move

SHOWN_DEG = 12.0
"""Angle that the largest rotation is drawn with: a picture's choice, no result."""
_POSED, _TRUE, _FOUND = "0.45", "tab:red", "tab:blue"


@dataclass(frozen=True, kw_only=True, slots=True)
class Plane:
    """A plane of the commanded sensor frame: the axes across and down, and its rotation."""

    rotation: str
    across: int
    down: int
    label: str


PLANES = {
    "pitch": Plane(rotation="pitch", across=1, down=2, label="along the travel, mm"),
    "roll": Plane(rotation="roll", across=0, down=2, label="along the laser line, mm"),
    "yaw": Plane(rotation="yaw", across=0, down=1, label="along the laser line, mm"),
}


def angles_deg(pose: NDArray[np.float64]) -> dict[str, float]:
    """Return roll, pitch and yaw of a mounting."""
    yaw, roll, pitch = Rotation.from_matrix(pose[:3, :3]).as_euler("ZYX", degrees=True)
    return {"roll": float(roll), "pitch": float(pitch), "yaw": float(yaw)}


def stretched(pose: NDArray[np.float64], times: float) -> NDArray[np.float64]:
    """Return a mounting with angles and offsets `times` as large."""
    out = np.eye(4)
    out[:3, :3] = Rotation.from_rotvec(
        times * Rotation.from_matrix(pose[:3, :3]).as_rotvec()
    ).as_matrix()
    out[:3, 3] = times * pose[:3, 3]
    return out


def stretch(moves: Sequence[NDArray[np.float64]]) -> int:
    """How many times as large as they are moves are drawn: one significant digit."""
    largest = max(abs(a) for pose in moves for a in angles_deg(pose).values())
    times = max(SHOWN_DEG / max(largest, 1e-3), 1.0)
    digit = int(10 ** int(np.log10(times)))
    return int(round(times / digit)) * digit


def title_of(move: Move) -> str:
    """Return the panel's title."""
    return f"the sensor's move, drawn {stretch(_poses(move))} times as large"


def plane_of(move: Move) -> Plane:
    """Return the plane that shows the largest rotation."""
    sizes: dict[str, float] = dict.fromkeys(PLANES, 0.0)
    for pose in _poses(move):
        for key, angle in angles_deg(pose).items():
            sizes[key] = max(sizes[key], abs(angle))
    return PLANES[max(sizes, key=lambda key: sizes[key])]


def _poses(move: Move) -> list[NDArray[np.float64]]:
    return [pose for pose in (move.true, move.found) if pose is not None]


def draw_move(axis: Any, move: Move) -> None:
    """Draw commanded, true and found sensor above the part."""
    given = [("hidden", move.true, _TRUE, "-"), ("found", move.found, _FOUND, "--")]
    moves = [(words, pose, colour, dash) for words, pose, colour, dash in given if pose is not None]
    times = stretch(_poses(move))
    plane = plane_of(move)
    depth = float(np.nanmedian(move.surface_mm))
    _draw_part(axis, move, plane)
    _draw_sensor(axis, np.eye(4), plane, depth, move, {"color": _POSED, "ls": ":", "lw": 1.4,
                 "label": "where the poses say"})  # fmt: skip
    for words, pose, colour, dash in moves:
        style = {"color": colour, "ls": dash, "lw": 1.4, "label": _label(words, pose)}
        _draw_sensor(axis, stretched(pose, times), plane, depth, move, style)
    axis.set_aspect("equal", adjustable="datalim")
    axis.set_xlabel(plane.label, fontsize=8)
    axis.set_ylabel("depth, mm" if plane.down == 2 else "along the travel, mm", fontsize=8)
    axis.invert_yaxis()
    axis.legend(fontsize=7, loc="best", frameon=False)


def _label(words: str, pose: NDArray[np.float64]) -> str:
    """List what shows in the digits that are written, a line each."""
    turns = [f"{key} {angle:.2f}°" for key, angle in angles_deg(pose).items() if abs(angle) >= 5e-3]
    shifts = [
        f"{key} {value:.2f} mm"
        for key, value in zip("xyz", pose[:3, 3], strict=True)
        if abs(value) >= 5e-3
    ]
    return "\n".join([f"{words}:", *turns, *shifts])


def _draw_part(axis: Any, move: Move, plane: Plane) -> None:
    """Fill the part below its middle section, or draw the scanned field from above."""
    rows, columns = move.surface_mm.shape
    if plane.down == 1:
        axis.fill(*_box(move.x_mm.min(), move.x_mm.max(), move.y_mm.min(), move.y_mm.max()),
                  color="0.85", label="scanned field")  # fmt: skip
        return
    if plane.across == 1:
        at, section = move.y_mm, move.surface_mm[:, columns // 2]
    else:
        at, section = move.x_mm, move.surface_mm[rows // 2]
    known = np.isfinite(section)
    at, section = at[known], section[known]
    order = np.argsort(at)
    below = np.nanmax(move.surface_mm) + 0.5 * np.ptp(move.surface_mm[np.isfinite(move.surface_mm)])
    axis.fill_between(at[order], section[order], below, color="0.75", label="part")


def _draw_sensor(
    axis: Any, pose: NDArray[np.float64], plane: Plane, depth: float, move: Move,
    style: dict[str, Any],
) -> None:  # fmt: skip
    """Draw the head's outline and its laser down to the part, moved by a pose."""
    size = 0.12 * depth
    reach = move.x_mm.max() if plane.across == 0 else 0.0
    box = np.zeros((5, 3))
    box[:, plane.across], box[:, plane.down] = _box(-size, size, -1.6 * size, 0.0)
    rays = np.zeros((3, 3))
    rays[[0, 2], 2] = depth
    rays[[0, 2], 0] = -reach, reach
    if plane.down == 1:  # from above: the laser line on the part
        box[:, 2], rays[1, 2] = depth, depth
        box[:, plane.down] = 0.0
    for line in (box, rays):
        points = line @ pose[:3, :3].T + pose[:3, 3]
        axis.plot(points[:, plane.across], points[:, plane.down], **style)
        style = {**style, "label": None}


def _box(left: float, right: float, top: float, bottom: float) -> tuple[list[float], list[float]]:
    return [left, right, right, left, left], [top, top, bottom, bottom, top]
