"""One beam: a line that is wider than its file says is so for every listed effect."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sensors.kept import Kept
from sensors.law import sheet_effects
from sensors.line_operator import line_sd_mm
from sensors.view import View

if TYPE_CHECKING:
    from sensors.effects.base import Effect

WIDTH = "line_sd_um"
SHAPED = ("camera_occlusion", "finite_spot", "edge_mixing")
"""Effects of the geometry whose size is the line's width."""
MOVING = ("finite_spot", "edge_mixing")
"""Those of them that move a reading."""
_SHIFTS: Kept[NDArray[np.float64]] = Kept(1)


def as_wide(listed: Sequence["Effect"], found: Mapping[str, "Effect"]) -> list["Effect"]:
    """Return the listed effects with the line as wide, against the file, as those found have it.

    Parameters
    ----------
    listed : effects of a sensor's file
    found : effects to be used in place of those of their name
    """
    factor = 1.0
    for effect in listed:
        other = found.get(effect.name)
        if effect.name in SHAPED and other is not None:
            was, now = getattr(effect, WIDTH), getattr(other, WIDTH)
            if was and now is not None:
                factor = now / was
                break
    if factor == 1.0:
        return list(listed)
    return [e if e.name in found else _scaled(e, factor) for e in listed]


def _scaled(effect: "Effect", factor: float) -> "Effect":
    width = getattr(effect, WIDTH, None) if effect.name in SHAPED else None
    if not width:
        return effect
    bounds = effect.parameter(WIDTH)
    return effect.with_parameters({WIDTH: min(max(width * factor, bounds.low), bounds.high)})


def merging_mm(view: View) -> float:
    """How far apart two levels that are lit may lie to be read as one."""
    listed = (e for e in sheet_effects(view) if e.name == "edge_mixing")
    return 1e-3 * max((float(getattr(e, "merge_um", 0.0)) for e in listed), default=0.0)


def listed_sd_mm(view: View) -> float:
    """Return the listed line's standard deviation where it is cut, mm; 0 without one."""
    listed = {e.name: e for e in sheet_effects(view) if not e.is_null}
    for name in reversed(MOVING):
        if name in listed:
            return float(line_sd_mm(view, getattr(listed[name], WIDTH), None))
    return 0.0


def listed_shift_mm(view: View) -> NDArray[np.float64]:
    """Return what the listed line's width makes of each reading, (n, m) mm; kept with the view."""

    def shift() -> NDArray[np.float64]:
        moving = (e for e in sheet_effects(view) if e.name in MOVING and not e.is_null)
        known = [s for s in (e.shift(view) for e in moving) if s is not None]
        return sum(known, np.zeros(view.shape))

    return _SHIFTS.get(view, None, shift)


def weakest_light(view: View) -> float:
    """Share of the line's light that makes a peak, as the listed shadows have it; 0 if unsaid."""
    from sensors.effects.camera_occlusion import CameraOcclusion

    listed = (e for e in sheet_effects(view) if isinstance(e, CameraOcclusion))
    return max((e.weakest for e in listed if e.line_sd_um > 0), default=0.0)
