"""Fixed-pattern error: an offset and a scale of each column."""

import math
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from sensors.effects.base import AdditiveEffect
from sensors.effects.parameter import parameter
from sensors.effects.relaxed import Relaxed
from sensors.law import Law
from sensors.piecewise_linear import hats
from sensors.view.view import View

Floats = NDArray[np.float64]

MOST_STARTED = 64
"""Offsets with which a fit starts at most."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ColumnOffset(AdditiveEffect):
    """A fixed pattern over the columns, the same in every profile and pose.

    A calibration table that converts rows to depths column by column has, to first order, an error
    of two parameters per column: an offset, and a scale about the working distance.
    """

    name: ClassVar = "column_offset"
    summary: ClassVar = (
        "Each column of the profile has a constant offset, or an error proportional to the depth."
    )
    equation: ClassVar = (
        "c(column) + s(column) (z - WD): values at evenly spaced columns, linear between; white in "
        "the columns where drawn from a seed"
    )
    source: ClassVar = (
        "Fixed pattern of sensor and calibration, 1 to 10 µm; 4 to 8 µm in public recordings of "
        "industrial sensors"
    )
    statement: ClassVar = (
        "Columns have constant offsets of {rms_um:.1f} µm (standard deviation){tilted} in every "
        "profile: stripes along the travel."
    )
    channels: ClassVar = ("mean",)
    frame: ClassVar = "sensor"
    covariate: ClassVar = "column"
    relaxed: ClassVar = (Relaxed(channel="mean", each="column"),)
    rivals: ClassVar = ("line_bow", "anisotropic_lay")
    separating: ClassVar = "shift the part along the line: the stripes stay with the columns"

    values_um: tuple[float, ...] = parameter(
        "offsets at columns evenly spaced over the profile",
        unit="µm",
        low=-1000.0,
        high=1000.0,
        typical=(),
        null=0.0,
        linear=True,
        kind="list",
    )
    scales_ppm: tuple[float, ...] = parameter(
        "relative errors of the depth about the working distance, at columns evenly spaced over "
        "the profile",
        unit="ppm",
        low=-100000.0,
        high=100000.0,
        typical=(),
        null=0.0,
        fixed=True,
        kind="list",
    )
    rms_um: float = parameter(
        "standard deviation of white offsets drawn from the seed, beside the values",
        unit="µm",
        low=0.0,
        high=1000.0,
        typical=4.0,
        default=0.0,
        null=0.0,
        linear=True,
        fixed=True,
    )
    seed: int = parameter(
        "seed of the pattern, which belongs to the instrument and not to a scan",
        low=0,
        high=4294967295,
        typical=1,
        kind="integer",
    )

    def starts(self, view: View) -> tuple[Self, ...]:
        """Return offsets of zero at each column, or of groups of columns."""
        return (self.with_parameters(values_um=(0.0,) * min(view.shape[1], MOST_STARTED)),)

    def fields(self, view: View) -> tuple[Floats, ...]:
        """Return a hat function over the columns for each value, and the seed's pattern."""
        columns = view.shape[1]
        pattern = np.random.default_rng(self.seed).standard_normal(columns)
        return tuple(1e-3 * f[None, :] for f in (*hats(len(self.values_um), columns), pattern))

    def changed(self, law: Law, view: View) -> Law:
        """Add the offsets, and the scale errors times the distance from the working distance."""
        law = AdditiveEffect.changed(self, law, view)  # a slotted class has no bare super()
        if not self.scales_ppm:
            return law
        scales = 1e-6 * np.array(self.scales_ppm) @ hats(len(self.scales_ppm), view.shape[1])
        away = view.depth_mm - view.datasheet.working_distance_mm
        return law.biased(scales * away)

    def words(self) -> dict[str, Any]:
        """Return the standard deviations of offsets and scales for the statement."""
        values = np.array(self.values_um or (0.0,))
        tilted = ""
        if self.scales_ppm:
            tilted = f" and scale errors of {np.std(self.scales_ppm):.0f} ppm"
        return {"rms_um": math.hypot(self.rms_um, float(values.std())), "tilted": tilted}
