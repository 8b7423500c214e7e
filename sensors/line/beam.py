"""The laser's line as the effects that a sensor's file lists state it, and what it reads."""

import math
from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from sensors.line.lambertian_light import lambertian_light
from sensors.line.line_operator import STEEPEST, Line, line_sd_mm, read_line
from sensors.line.line_spread import LineSpread, line_spread, step_between
from sensors.line.peak_finder import above_threshold
from sensors.view.view import KEPT_IN_ALL, KEPT_WIDTHS, View
from sensors.view.view_cache import ViewCache

FINELY = 0.4
"""Longest step, in standard deviations, with which a line is sampled that edges may cut."""
_SHIFTS: ViewCache[NDArray[np.float64]] = ViewCache(2)
_READ: ViewCache[Line] = ViewCache(KEPT_WIDTHS, room=KEPT_IN_ALL)


class Width(Protocol):
    """An effect of the line's width on readings, as a sensor's file lists it."""

    @property
    def line_sd_um(self) -> float | None:
        """Standard deviation of the line for which it holds, µm; None: the datasheet's."""
        ...

    def as_measured(self) -> Self:
        """Return the effect of the line as it was when the file's figures were measured."""
        ...

    def shift(self, view: View) -> NDArray[np.float64] | None:
        """Return the change of the mean, (n, m) mm."""
        ...


@dataclass(frozen=True, kw_only=True, slots=True)
class Beam:
    """The laser's line; each listed effect adds what it states (`Effect.stated_on`).

    Attributes
    ----------
    spot, cut : how its width rounds readings, and mixes them where an edge cuts it; None: unsaid
    sd_um : current standard deviation of the line; 0: that at which spot and cut were measured
    along_um : standard deviation of the footprint along the line
    merge_um : how far apart two levels that are lit may lie to be read as one
    weakest : share of the line's light that makes a peak; 0 if unsaid
    """

    spot: Width | None = None
    cut: Width | None = None
    sd_um: float = 0.0
    along_um: float = 0.0
    merge_um: float = 0.0
    weakest: float = 0.0

    @property
    def widths(self) -> tuple[Width, ...]:
        """The listed effects of the line's width on readings."""
        return tuple(one for one in (self.spot, self.cut) if one is not None)

    @property
    def stated_um(self) -> float | None:
        """Width of the line where it is cut, else where it rounds; None: unsaid or the sheet's."""
        return self.widths[-1].line_sd_um if self.widths else None


def stated_sd_mm(view: View) -> float:
    """Return the standard deviation for which the file states what edges do, mm; or 0."""
    beam = view.sensor.beam
    return float(line_sd_mm(view, beam.stated_um, None)) if beam.widths else 0.0


def listed_sd_mm(view: View) -> float:
    """Return the listed line's standard deviation, mm; 0 without one."""
    return 1e-3 * view.sensor.beam.sd_um or stated_sd_mm(view)


def wider_mm(view: View, sd_mm: float) -> NDArray[np.float64]:
    """Return the depth that a line of this width reads beyond the stated one, (n, m) mm.

    The difference of two lines on matt material; where the file has another level than the
    narrow one reads, what the wide one reads.
    """
    stated = stated_sd_mm(view)
    if stated == 0.0:
        return np.zeros(view.shape)
    now = read_beam(view, _finely(sd_mm))
    stood = read_beam(view, _finely(stated)).depth_mm
    filed = view.depth_mm + listed_shift_mm(view, measured=True)
    change = now.depth_mm - np.where(np.abs(filed - stood) <= STEEPEST * stated, stood, filed)
    return np.where(np.isfinite(change) & (now.light >= view.sensor.beam.weakest), change, 0.0)


def _finely(sd_mm: float) -> LineSpread:
    """Sample a line that stands finely enough for one that an edge cuts."""
    return line_spread(sd_mm, 0.0, 0.0, step_between(FINELY * sd_mm, 0.0))


def read_beam(view: View, line: LineSpread) -> Line:
    """Read a line; where the camera's place is stated, matt light that it sees.

    The last few are kept with the view: what a line reads has nothing to do with the noise.
    """
    key = (*(a.tobytes() for a in (line.offsets_mm, line.light, line.within_mm)), line.sd_mm)
    return _READ.get(view, key, lambda: _read(view, line), size=math.prod(view.shape))


def _read(view: View, line: LineSpread) -> Line:
    beam, seen = view.sensor.beam, view.datasheet.triangulation_angle_deg is not None
    merge_mm = 1e-3 * beam.merge_um
    read = read_line(
        view, line.offsets_mm, list(line.light[..., None]), within_mm=line.within_mm,
        camera=seen, visible=seen, radiance=lambertian_light if seen else None,
        merge_mm=merge_mm,
    )  # fmt: skip
    if not seen:
        return read
    return above_threshold(view, line, read, least=beam.weakest, merge_mm=merge_mm)


def listed_shift_mm(view: View, *, measured: bool = False) -> NDArray[np.float64]:
    """Return what the listed line's width makes of each reading, (n, m) mm; kept with the view.

    Parameters
    ----------
    measured : of the line at which the file's figures were measured, not of the current one
    """
    widths = view.sensor.beam.widths
    if measured:
        widths = tuple(one.as_measured() for one in widths)

    def shift() -> NDArray[np.float64]:
        known = [s for s in (one.shift(view) for one in widths) if s is not None]
        return sum(known, np.zeros(view.shape))

    return _SHIFTS.get(view, widths, shift)
