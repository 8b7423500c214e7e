"""Outlines of lines and tangent arcs, and their exact parallel curves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def arc_steps(radius_mm: float, angle_rad: float, facet_mm: float) -> int:
    """Chords over an arc that keep its sagitta r (1 - cos(step / 2)) within facet_mm."""
    step = 2.0 * np.arccos(1.0 - min(facet_mm, 0.3 * radius_mm) / radius_mm)
    return max(1, int(np.ceil(abs(angle_rad) / step - 1e-9)))


class Pen:
    """Draws an outline: straight on, or turning along arcs, tangent to what came before.

    The parallel curve at distance d to the left is `points + d * normals`; an arc that turns left
    has the radius r - d there, one that turns right r + d.
    """

    def __init__(self, x_mm: float, y_mm: float, heading_rad: float, facet_mm: float) -> None:
        self._at = np.array([x_mm, y_mm])
        self._heading = heading_rad
        self._facet_mm = facet_mm
        self._points: list[Array] = [self._at]
        self._normals: list[Array] = [self._left()]

    def _left(self) -> Array:
        return np.array([-np.sin(self._heading), np.cos(self._heading)])

    def line(self, length_mm: float) -> Pen:
        """Go straight on."""
        ahead = np.array([np.cos(self._heading), np.sin(self._heading)])
        self._at = self._at + length_mm * ahead
        self._points.append(self._at)
        self._normals.append(self._left())
        return self

    def arc(self, radius_mm: float, turn_rad: float, widest_mm: float | None = None) -> Pen:
        """Turn along an arc, left for positive angles; fine enough for a radius of `widest_mm`."""
        count = arc_steps(radius_mm if widest_mm is None else widest_mm, turn_rad, self._facet_mm)
        way = np.sign(turn_rad)
        centre = self._at + way * radius_mm * self._left()
        start = self._heading
        for k in range(1, count + 1):
            self._heading = start + turn_rad * k / count
            self._at = centre - way * radius_mm * self._left()
            self._points.append(self._at)
            self._normals.append(self._left())
        return self

    @property
    def points_mm(self) -> Array:
        """(n, 2) points drawn so far, mm."""
        return np.array(self._points)

    @property
    def normals(self) -> Array:
        """(n, 2) unit normals at the points, to the left of the way."""
        return np.array(self._normals)
