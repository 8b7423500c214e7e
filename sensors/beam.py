"""One beam: a line that is wider than its file says is so for every listed effect."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from sensors.law import sheet_effects
from sensors.view import View

if TYPE_CHECKING:
    from sensors.effects.base import Effect

WIDTH = "line_sd_um"
SHAPED = ("camera_occlusion", "finite_spot", "edge_mixing")
"""Effects of the geometry whose size is the line's width."""


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
