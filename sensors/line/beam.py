"""One beam: a line that is wider than its file says is so for every listed effect."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sensors.law import sheet_effects
from sensors.line.light import matt
from sensors.line.line_operator import STEEPEST, Line, line_sd_mm, read_line
from sensors.line.line_spread import Smear, smear, step_between
from sensors.line.thin_light import above_threshold
from sensors.view.kept import Kept
from sensors.view.view import View

if TYPE_CHECKING:
    from sensors.effects.base import Effect

WIDTH = "line_sd_um"
BEAM = "beam_um"
ALONG = "along_um"
SHAPED = ("camera_occlusion", "finite_spot", "edge_mixing")
"""Effects of the geometry whose size is the line's width."""
MOVING = ("finite_spot", "edge_mixing")
"""Those of them that move a reading."""
FINELY = 0.4
"""Longest step, in standard deviations, with which a line is sampled that edges may cut."""
_SHIFTS: Kept[NDArray[np.float64]] = Kept(2)
_STANDING: Kept[Line] = Kept(4)


def as_wide(listed: Sequence["Effect"], found: Mapping[str, "Effect"]) -> list["Effect"]:
    """Return the listed effects with the line as wide, against the file, as those found have it.

    Parameters
    ----------
    listed : effects of a sensor's file
    found : effects to be used in place of those of their name
    """
    factor, shaped = 1.0, set(SHAPED)
    for effect in listed:
        other = found.get(effect.name)
        if effect.name not in SHAPED or other is None:
            continue
        was, now = getattr(effect, WIDTH), getattr(other, WIDTH)
        if getattr(other, BEAM, 0.0):
            # it says by itself what becomes of readings; which of them are lost it doesn't
            was = getattr(effect, BEAM) or _told_um({e.name: e for e in listed})
            now, shaped = getattr(other, BEAM), set(SHAPED) - set(MOVING)
        if was and now is not None:
            factor = now / was
            break
    if factor == 1.0:
        return list(listed)
    return [_scaled(e, factor) if e.name in shaped - set(found) else e for e in listed]


def _scaled(effect: "Effect", factor: float) -> "Effect":
    width = getattr(effect, WIDTH)
    if not width:
        return effect
    bounds = effect.parameter(WIDTH)
    return effect.with_parameters({WIDTH: min(max(width * factor, bounds.low), bounds.high)})


def merging_mm(view: View) -> float:
    """How far apart two levels that are lit may lie to be read as one."""
    listed = (e for e in sheet_effects(view) if e.name == "edge_mixing")
    return 1e-3 * max((float(getattr(e, "merge_um", 0.0)) for e in listed), default=0.0)


def told_sd_mm(view: View) -> float:
    """Return the line's standard deviation for which the file tells what edges do, mm; or 0."""
    listed = {e.name: e for e in sheet_effects(view) if not e.is_null}
    if not any(name in listed for name in MOVING):
        return 0.0
    return float(line_sd_mm(view, _told_um(listed), None))


def _told_um(listed: Mapping[str, "Effect"]) -> float | None:
    """Width of the line where it is cut, else where it rounds creases; None: the datasheet's."""
    return next((getattr(listed[k], WIDTH) for k in reversed(MOVING) if k in listed), None)


def listed_sd_mm(view: View) -> float:
    """Return the listed line's standard deviation, mm; 0 without one."""
    beams = (getattr(e, BEAM, 0.0) for e in sheet_effects(view))
    return 1e-3 * max(beams, default=0.0) or told_sd_mm(view)


def listed_along_mm(view: View) -> float:
    """Return the listed footprint's standard deviation along the line, mm; 0 without one."""
    return 1e-3 * max((getattr(e, ALONG, 0.0) for e in sheet_effects(view)), default=0.0)


def wider_mm(view: View, sd_mm: float) -> NDArray[np.float64]:
    """How much deeper a line that wide reads than the one the file tells of, (n, m) mm.

    The difference of two lines on matt material; where the file has another level than the
    narrow one reads, what the wide one reads.
    """
    told = told_sd_mm(view)
    if told == 0.0:
        return np.zeros(view.shape)
    now = read_beam(view, _finely(sd_mm))
    stood = standing(view, _finely(told)).depth_mm
    filed = view.depth_mm + listed_shift_mm(view, told=True)
    change = now.depth_mm - np.where(np.abs(filed - stood) <= STEEPEST * told, stood, filed)
    return np.where(np.isfinite(change) & (now.light >= weakest_light(view)), change, 0.0)


def _finely(sd_mm: float) -> Smear:
    """Sample a line that stands finely enough for one that an edge cuts."""
    return smear(sd_mm, 0.0, 0.0, step_between(FINELY * sd_mm, 0.0))


def read_beam(view: View, line: Smear) -> Line:
    """Read a line; where the camera's place is stated, matt light that it sees."""
    seen, merge_mm = view.datasheet.triangulation_angle_deg is not None, merging_mm(view)
    read = read_line(
        view, line.offsets_mm, list(line.light[..., None]), within_mm=line.within_mm,
        camera=seen, visible=seen, radiance=matt if seen else None, merge_mm=merge_mm,
    )  # fmt: skip
    if not seen:
        return read
    return above_threshold(view, line, read, least=weakest_light(view), merge_mm=merge_mm)


def standing(view: View, line: Smear) -> Line:
    """Read a line that doesn't move; kept for the next who asks."""
    key = float(line.variance[0]), line.step_mm
    return _STANDING.get(view, key, lambda: read_beam(view, line))


def listed_shift_mm(view: View, *, told: bool = False) -> NDArray[np.float64]:
    """Return what the listed line's width makes of each reading, (n, m) mm; kept with the view.

    Parameters
    ----------
    told : of the line as it was when the file's figures were measured, not as it is by now
    """
    moving = [e for e in sheet_effects(view) if e.name in MOVING and not e.is_null]
    if told:
        moving = [e.with_parameters({BEAM: 0.0}) if hasattr(e, BEAM) else e for e in moving]

    def shift() -> NDArray[np.float64]:
        known = [s for s in (e.shift(view) for e in moving) if s is not None]
        return sum(known, np.zeros(view.shape))

    return _SHIFTS.get(view, tuple(moving), shift)


def weakest_light(view: View) -> float:
    """Share of the line's light that makes a peak, as the listed shadows have it; 0 if unsaid."""
    from sensors.effects.camera_occlusion import CameraOcclusion

    listed = (e for e in sheet_effects(view) if isinstance(e, CameraOcclusion))
    return max((e.weakest for e in listed if e.line_sd_um > 0), default=0.0)
