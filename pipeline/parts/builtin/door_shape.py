"""The door panel as a surface: crown, shoulder line, tucked foot, recess, hem, window edge."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pipeline.parts.builtin.recess import Recess

if TYPE_CHECKING:
    from pipeline.parts.builtin.car_door import CarDoor

Array = NDArray[np.float64]
_BAND = 1.0 / 32.0  # of the square's half width: the strip that is folded; one first cell
_FOOT_MM = 60.0  # width over which the shoulder line runs out


class DoorShape:
    """Both faces of the sheet over the square [-1, 1]²; x along the car, y up, z outward."""

    def __init__(self, door: CarDoor) -> None:
        self.door = door
        self.half_x = door.length_mm / 2.0
        self.half_y = door.height_mm / 2.0
        self.recess = Recess(
            x_mm=0.55 * self.half_x,
            y_mm=0.27 * self.half_y,
            length_mm=door.recess_length_mm,
            width_mm=door.recess_width_mm,
            depth_mm=door.recess_depth_mm,
            wall_rad=float(np.radians(door.recess_wall_deg)),
            rim_radius_mm=door.recess_rim_radius_mm,
            floor_radius_mm=door.recess_floor_radius_mm,
        )

    def height(self, x_mm: Array, y_mm: Array) -> tuple[Array, Array, Array]:
        """Height of the skin over (x, y), mm, and its derivatives along x and y."""
        door = self.door
        z = -(x_mm**2) / (2.0 * door.radius_x_mm) - y_mm**2 / (2.0 * door.radius_y_mm)
        z_x, z_y = -x_mm / door.radius_x_mm, -y_mm / door.radius_y_mm
        # Shoulder line: a ridge between two hyperbolas, crest radius and height as given.
        slope = door.line_height_mm / _FOOT_MM
        crest = door.line_radius_mm * slope
        d = self.line_distance_mm(x_mm, y_mm)
        foot, sharp = np.hypot(d, _FOOT_MM + crest), np.sqrt(d**2 + crest**2 + 1e-300)
        z = z + slope * (foot - sharp)
        rise = slope * d * (1.0 / foot - 1.0 / sharp)
        tilt = self._line_tilt
        norm = np.hypot(1.0, tilt)
        z_x, z_y = z_x - rise * tilt / norm, z_y + rise / norm
        # The foot of the door steps in towards the sill.
        width = 22.0
        step = np.tanh((y_mm + 0.62 * self.half_y + 0.02 * x_mm) / width)
        z = z + 0.5 * door.tuck_mm * (step - 1.0)
        lean = 0.5 * door.tuck_mm * (1.0 - step**2) / width
        z_x, z_y = z_x + 0.02 * lean, z_y + lean
        depth, d_x, d_y = self.recess.depth(x_mm, y_mm)
        return z - depth, z_x - d_x, z_y - d_y

    @property
    def _line_tilt(self) -> float:
        return 0.045

    def line_distance_mm(self, x_mm: Array, y_mm: Array) -> Array:
        """Signed distance from the shoulder line, mm, positive above it."""
        tilt = self._line_tilt
        return np.asarray((y_mm - 0.60 * self.half_y - tilt * x_mm) / np.hypot(1.0, tilt))

    def where(self, a: Array, b: Array) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
        """Plan position x, y, mm; how far into the folded strip (0 to 1); whether at the window."""
        rho, u, v = _rings(a, b)
        x, y = self._plan(u, v, np.minimum(rho / (1.0 - _BAND), 1.0))
        fold = np.maximum(rho - (1.0 - _BAND), 0.0) / _BAND
        return x, y, fold, self._window(u, v) > 0.5

    def sheet(self, a: Array, b: Array) -> tuple[Array, Array]:
        """Points of the outer and the inner face, (n, 3) each, mm."""
        door = self.door
        rho, u, v = _rings(a, b)
        x, y = self._plan(u, v, np.minimum(rho / (1.0 - _BAND), 1.0))
        z, z_x, z_y = self.height(x, y)
        normal = np.stack([-z_x, -z_y, np.ones_like(x)], axis=1)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        outer = np.stack([x, y, z], axis=1)
        folded = np.flatnonzero(rho > 1.0 - _BAND)
        if len(folded):
            share = (rho[folded] - (1.0 - _BAND)) / _BAND
            out = self._outward(u[folded], v[folded], normal[folded])
            outer[folded], normal[folded] = self._fold(
                outer[folded], normal[folded], out, share, self._window(u[folded], v[folded])
            )
        return outer, outer - door.sheet_mm * normal

    def _plan(self, u: Array, v: Array, rho: Array) -> tuple[Array, Array]:
        """Plan position of ring `rho` in the direction of the square's border point (u, v).

        Rings are rectangles in the middle and take up the rounded corners outward; the whole is
        then bent into the outline of a door, wider at the sill, its front edge leaning.
        """
        hx, hy = self.half_x, self.half_y
        radius = np.where(v > 0.0, self.door.window_corner_mm, self.door.corner_radius_mm)
        px, py = hx * u, hy * v
        # Position along the corner: its arc replaces a length of `reach` along either side.
        reach = 1.25 * radius
        gap_x, gap_y = hx - np.abs(px), hy - np.abs(py)
        at_x = np.abs(u) >= np.abs(v)
        along = np.where(at_x, gap_y, gap_x)
        corner = along < reach
        angle = np.where(corner, (1.0 - along / reach) * np.pi / 4.0, 0.0)
        # The straight part is stretched to end where the arc begins.
        total_x, total_y = hx - reach, hy - reach
        stretch_x, stretch_y = (hx - radius) / total_x, (hy - radius) / total_y
        straight_x = np.clip(px, -total_x, total_x) * stretch_x
        straight_y = np.clip(py, -total_y, total_y) * stretch_y
        cos, sin = radius * np.cos(angle), radius * np.sin(angle)
        rx = np.where(at_x, np.sign(u) * (hx - radius + cos), straight_x + np.sign(u) * sin)
        ry = np.where(at_x, straight_y + np.sign(v) * sin, np.sign(v) * (hy - radius + cos))
        weight = rho**3
        x = rho * (px + weight * (rx - px))
        y = rho * (py + weight * (ry - py))
        s, t = x / hx, y / hy
        x = x + 0.05 * hx * t * t - 0.06 * hx * t * (1.0 - 0.6 * s) + 0.025 * hx * s * (1.0 - t * t)
        y = y + 0.03 * hy * s * (1.0 + t) + 0.03 * hy * t * (1.0 - s * s)
        return x, y

    def _window(self, u: Array, v: Array) -> Array:
        """1 at the window edge (the upper side), 0 at the hem, smooth between, at the corners."""
        side = self.half_y * (1.0 - v)
        reach = 1.25 * self.door.window_corner_mm
        along_top = self.half_x * (1.0 - np.abs(u))
        # From the end of the arc on the side (0) over the corner to its end on top (1).
        progress = np.where(
            np.abs(u) >= np.abs(v), 0.5 - 0.5 * side / reach, 0.5 + 0.5 * along_top / reach
        )
        progress = np.where(v > 0.0, np.clip(progress, 0.0, 1.0), 0.0)
        return np.asarray(progress**3 * (10.0 - 15.0 * progress + 6.0 * progress**2))

    def _outward(self, u: Array, v: Array, normal: Array) -> Array:
        """Find the unit vectors in the surface that point across the outline, outward."""
        step = 1e-5
        # A step along the square's border, counter-clockwise.
        right = np.abs(u) >= np.abs(v)
        du = np.where(right, 0.0, -np.sign(v)) * step
        dv = np.where(right, np.sign(u), 0.0) * step
        one = np.ones_like(u)
        ends = []
        for sign in (-1.0, 1.0):
            x, y = self._plan(*_border(u + sign * du, v + sign * dv), one)
            ends.append(np.stack([x, y, self.height(x, y)[0]], axis=1))
        along = ends[1] - ends[0]
        out = np.cross(along, normal)
        return np.asarray(out / np.linalg.norm(out, axis=1, keepdims=True))

    def _fold(
        self, base: Array, normal: Array, out: Array, share: Array, window: Array
    ) -> tuple[Array, Array]:
        """Bend the strip beyond the outline: an arc, then straight; points and normals."""
        door = self.door
        radius = door.hem_radius_mm + window * (door.window_radius_mm - door.hem_radius_mm)
        angle = np.pi * (1.0 - window) + window * np.radians(82.0)
        length = door.hem_return_mm + window * (door.window_flange_mm - door.hem_return_mm)
        # The first half of the strip is the arc, the second the straight part.
        turn = angle * np.clip(2.0 * share, 0.0, 1.0)
        run = length * np.clip(2.0 * share - 1.0, 0.0, 1.0)
        cos, sin = np.cos(turn), np.sin(turn)
        forward = radius * sin + run * cos
        down = radius * (1.0 - cos) + run * sin
        points = base + forward[:, None] * out - down[:, None] * normal
        return points, sin[:, None] * out + cos[:, None] * normal


def _rings(a: Array, b: Array) -> tuple[Array, Array, Array]:
    """Ring (0 to 1) of square coordinates and the border point in their direction."""
    rho = np.maximum(np.abs(a), np.abs(b))
    safe = np.where(rho > 0.0, rho, 1.0)
    return rho, np.where(rho > 0.0, a / safe, 1.0), np.where(rho > 0.0, b / safe, 0.0)


def _border(u: Array, v: Array) -> tuple[Array, Array]:
    """Points stepped along the border, carried round its corners.

    What a step overshoots on one side is walked on the next.
    """
    over_u, over_v = np.maximum(np.abs(u) - 1.0, 0.0), np.maximum(np.abs(v) - 1.0, 0.0)
    return (
        np.sign(u) * (np.abs(u) - over_u - over_v),
        np.sign(v) * (np.abs(v) - over_v - over_u),
    )
