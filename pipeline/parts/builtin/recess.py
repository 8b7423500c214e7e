"""A drawn recess: stadium outline, flat floor, walls of one slope between two radii."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class Recess:
    """A stadium about (x, y), long along x; sizes in mm, seen along -z.

    Its section is a floor, a concave arc, a wall of constant slope and a convex rim arc, all
    tangent to one another.
    """

    x_mm: float
    y_mm: float
    length_mm: float
    width_mm: float
    depth_mm: float
    wall_rad: float
    rim_radius_mm: float
    floor_radius_mm: float

    @property
    def rim_mm(self) -> float:
        """Distance from the stadium's middle line at which the recess begins."""
        return self.width_mm / 2.0

    @property
    def wall_mm(self) -> tuple[float, float]:
        """Distances from the middle line between which the wall is straight."""
        outer = self.rim_mm - self.rim_radius_mm * np.sin(self.wall_rad)
        arcs = (self.rim_radius_mm + self.floor_radius_mm) * (1.0 - np.cos(self.wall_rad))
        return float(outer - (self.depth_mm - arcs) / np.tan(self.wall_rad)), float(outer)

    @property
    def floor_mm(self) -> float:
        """Distance from the middle line up to which the floor is flat."""
        return float(self.wall_mm[0] - self.floor_radius_mm * np.sin(self.wall_rad))

    def distance_mm(self, x_mm: Array, y_mm: Array) -> Array:
        """Distance of points from the stadium's middle line, mm."""
        half = (self.length_mm - self.width_mm) / 2.0
        along = np.maximum(np.abs(x_mm - self.x_mm) - half, 0.0)
        return np.hypot(along, y_mm - self.y_mm)

    def on_wall(self, q_mm: Array) -> NDArray[np.bool_]:
        """Whether points at such distances lie on the straight wall."""
        low, high = self.wall_mm
        return np.asarray((q_mm > low) & (q_mm < high))

    def depth(self, x_mm: Array, y_mm: Array) -> tuple[Array, Array, Array]:
        """Depth below the panel, mm, and its derivatives along x and y."""
        half = (self.length_mm - self.width_mm) / 2.0
        from_x = x_mm - self.x_mm
        along = np.sign(from_x) * np.maximum(np.abs(from_x) - half, 0.0)
        aside = y_mm - self.y_mm
        q = np.hypot(along, aside)
        low, high = self.wall_mm
        rim, floor, tan = self.rim_mm, self.floor_mm, np.tan(self.wall_rad)
        r1, r2 = self.rim_radius_mm, self.floor_radius_mm
        into = np.clip(rim - q, 0.0, rim - high)
        up = np.clip(q - floor, 0.0, low - floor)
        root1, root2 = np.sqrt(r1**2 - into**2), np.sqrt(r2**2 - up**2)
        wall = r1 * (1.0 - np.cos(self.wall_rad)) + (high - q) * tan
        depth = np.where(q > high, r1 - root1, np.where(q > low, wall, self.depth_mm - r2 + root2))
        slope = np.where(q > high, -into / root1, np.where(q > low, -tan, -up / root2))
        scale = np.divide(slope, q, where=q > 0.0, out=np.zeros_like(q))
        return depth, scale * along, scale * aside
