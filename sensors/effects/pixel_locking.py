"""Pixel locking: an error of the peak position that is periodic in the camera's rows."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from sensors.effects.base import AdditiveEffect
from sensors.effects.parameter import parameter
from sensors.effects.relaxed import Relaxed
from sensors.effects.sinusoid import SinusoidalEffect
from sensors.law import Law
from sensors.view.camera import depth_per_row, row_of_depth
from sensors.view.view import View

Floats = NDArray[np.float64]


ROUNDING = (0.0, -0.5, 0.5)
"""Rounding errors of the stated number of rows in a search."""
LEAST_SLOPE = 0.2
"""Smallest slope from true to located row; higher harmonics keep the slope above zero."""
BENDS = (0.0, -0.3, 0.3, -0.6, 0.6, -1.0, 1.0)
"""Smiles in a search, rows."""


@dataclass(frozen=True, kw_only=True, slots=True)
class PixelLocking(SinusoidalEffect, AdditiveEffect):
    """A sine of the fractional camera row, converted to depth."""

    name: ClassVar = "pixel_locking"
    summary: ClassVar = (
        "The peak's position between pixel rows has an error with a period of one row: a fine "
        "ripple in range."
    )
    equation: ClassVar = (
        "δv = A sin(2π v + φ) rows, δz = δv dz/dv, σ = σ0 |1 + 2π A cos(2π v + φ)|; centre of "
        "gravity of a spot of σ rows: A = exp(-2π²σ²)/π"
    )
    source: ClassVar = (
        "Fourier series of a centre of gravity over whole pixels: Alexander and Ng, Opt. Eng. 30 "
        "(1991) 1320"
    )
    statement: ClassVar = (
        "The depth has a ripple with the period of a camera row and an amplitude of "
        "{amplitude_px:.3f} row."
    )
    channels: ClassVar = ("mean", "variance")
    frame: ClassVar = "sensor"
    covariate: ClassVar = "camera_row"
    relaxed: ClassVar = (
        Relaxed(channel="mean", along=("camera_row",), periodic=True, frequency="rows"),
    )
    rivals: ClassVar = ("stage_vibration", "travel_ripple")
    separating: ClassVar = (
        "scan a plate tilted along the line: the ripple follows range, a vibration follows time"
    )
    needs: ClassVar = ("triangulation_angle_deg",)

    amplitude_px: float = parameter(
        "amplitude A in camera rows",
        unit="px",
        low=0.0,
        high=0.5,
        typical=0.05,
        null=0.0,
        linear=True,
    )
    phase_rad: float = parameter(
        "phase φ relative to the rows",
        unit="rad",
        low=0.0,
        high=6.2831853072,
        typical=0.0,
    )
    rows: float | None = parameter(
        "camera rows over the working range",
        low=16.0,
        high=16384.0,
        typical=1024.0,
        sheet="camera_rows",
    )

    smile_rows: float = parameter(
        "bend of a level line's image: displacement of its ends, rows",
        low=-8.0,
        high=8.0,
        typical=0.0,
    )
    keystone_rows: float = parameter(
        "rotation of a level line's image: displacement at the corners of the range, rows",
        low=-8.0,
        high=8.0,
        typical=0.0,
    )

    def changed(self, law: Law, view: View) -> Law:
        """Add the ripple; the slope of the same curve scales the noise of the row."""
        law = AdditiveEffect.changed(self, law, view)
        _, turn = self._turn(view)
        slope = 1 + 2 * math.pi * self.amplitude_px * np.cos(turn + self.phase_rad)
        gain = np.nan_to_num(np.maximum(np.abs(slope), LEAST_SLOPE), nan=1.0)
        return law.noisier(gain)

    def fields(self, view: View) -> tuple[Floats, ...]:
        """Return sine and cosine of the row, each times the depth of one row."""
        height, turn = self._turn(view)
        return height * np.sin(turn), height * np.cos(turn)

    def covariate_values(self, view: View) -> Floats:
        """Return the fraction of the row, (n, m), by the effect's rows and bends."""
        return np.asarray(self._turn(view)[1] / (2 * math.pi) % 1.0)

    def _turn(self, view: View) -> tuple[Floats, Floats]:
        """Depth of a row (mm) and 2π times the row where each point is imaged, (n, m)."""
        sheet = view.datasheet
        rows = sheet.require("camera_rows") if self.rows is None else self.rows
        row = row_of_depth(view.depth_mm, sheet, rows)
        if self.smile_rows or self.keystone_rows:
            across = view.column_off_axis_mm
            across = across / max(float(np.abs(across).max()), 1e-9)
            along = 2 * row / rows - 1
            row = row + self.smile_rows * across**2 + self.keystone_rows * across * along
        return depth_per_row(view.depth_mm, sheet, rows), np.asarray(2 * math.pi * row)

    def grid(self, view: View) -> tuple["PixelLocking", ...]:
        """Return bends at the stated rows and their rounding; without rows, half cycles."""
        stated = view.datasheet.camera_rows if self.rows is None else self.rows
        if stated is not None:
            return tuple(
                self.with_parameters(rows=float(stated + off), smile_rows=bend)
                for off in ROUNDING
                for bend in BENDS
            )
        if not view.in_range.any():
            return (self,)
        low, high = self.parameter("rows").low, self.parameter("rows").high
        ends = np.array([np.nanmin(view.depth_mm), np.nanmax(view.depth_mm)])
        part = abs(float(np.diff(row_of_depth(ends, view.datasheet, 1.0))[0]))
        step = max(0.5 / max(part, 1e-6), 1.0)
        count = min(512, int((high - low) / step) + 1)
        return tuple(self.with_parameters(rows=low + i * step) for i in range(count))
