"""Whether a height map can be what it seems: sentinels, units, sizes; in doubt it is refused."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from files.errors import RecipeError
from sensors.formats.height_map import Floats

LEAST_READINGS = 40
"""Smallest number of readings for a test of repetition."""
APART = 0.5
"""A value stands apart where it is further from all other readings than this share of their span.
A measured part has readings on its flanks and noise around its levels."""
STEPS = 25.0
"""... or further than so many of the usual steps between levels, while it repeats often."""
FEW_STEPS = 5.0
"""Fewer steps of a coarse scale than this are no gap."""
OFTEN = 0.005
REPEATS = 3
MOST_SPAN = 8.0
"""Height span over the wider lateral side from which a unit is doubted: profilometers measure
ranges up to about twice the width of their line."""
LEAST_SPAN = 1e-8
LEAST_FIELD_MM, MOST_FIELD_MM = 0.3, 5000.0
"""Widths between which places of no stated unit may be mm: from the field of a confocal line
sensor to the longest gantry's."""
HUGE = 1e30
"""Readings beyond this (in their own unit) are overflow marks, never lengths."""

INTEGER_MARKS = (-32768.0, 32767.0, 65535.0, -2147483648.0, 2147483647.0, 4294967295.0)


@dataclass(frozen=True, kw_only=True, slots=True)
class Sentinel:
    """One exact number, isolated from all readings, that repeats.

    Attributes
    ----------
    value
        In the file's own numbers.
    count
        Number of occurrences.
    low, high
        Range of the other readings, in the file's own numbers.
    """

    value: float
    count: int
    low: float
    high: float


def sentinels(values: Floats) -> tuple[Sentinel, ...]:
    """Find isolated, repeated numbers at either end of the range.

    Parameters
    ----------
    values : (n, m)
        Readings in the file's own numbers; NaN is missing already.
    """
    finite = values[np.isfinite(values)]
    levels, counts = np.unique(finite, return_counts=True)
    found: list[Sentinel] = []
    while len(levels) > 1 and counts.sum() >= LEAST_READINGS:
        ends = [
            (end, one)
            for end in (0, -1)
            if (one := _apart(levels, counts, end)) is not None
        ]
        if not ends:
            break
        # The end that stands further off first: it hides the other.
        end, one = max(ends, key=lambda pair: abs(pair[1].value - (pair[1].low + pair[1].high) / 2))
        found.append(one)
        kept = slice(1, None) if end == 0 else slice(None, -1)
        levels, counts = levels[kept], counts[kept]
    return tuple(found)


def _apart(levels: Floats, counts: NDArray[np.int64], end: int) -> Sentinel | None:
    value, count = float(levels[end]), int(counts[end])
    rest = levels[1:] if end == 0 else levels[:-1]
    gap = abs(value - float(rest[end]))
    low, high = float(rest[0]), float(rest[-1])
    span = high - low
    total = int(counts.sum())
    marked = value in INTEGER_MARKS or abs(value) > HUGE
    if count < (1 if marked else REPEATS):
        return None
    steps = np.diff(rest)
    usual = float(np.median(steps)) if len(steps) else 0.0
    # A single level beside another one is a step between two planes seen without noise.
    apart = len(rest) > 2 and gap > APART * span and gap > FEW_STEPS * usual
    often = len(rest) > 2 and count >= OFTEN * total and gap > STEPS * usual and (
        gap > 4.0 * float(np.quantile(steps, 0.999)) if len(steps) > 8 else False
    )  # fmt: skip
    if not (apart or often or (marked and gap > STEPS * usual)):
        return None
    return Sentinel(value=value, count=count, low=low, high=high)


def check_sentinels(values: Floats) -> None:
    """Stop where a number may mark missing points.

    Raises
    ------
    RecipeError
        Naming each mark and the option that declares it.
    """
    found = sentinels(values)
    if not found:
        return
    words = "; ".join(
        f"{one.value:.9g} {one.count} times, all else lies in {one.low:.6g} to {one.high:.6g}"
        for one in found
    )
    options = " ".join(f"--missing {one.value:.9g}" for one in found)
    raise RecipeError(
        f"holds a number that may mark missing points: {words}",
        allowed=f"{options} if the number marks missing points, --no-check if it is a reading",
    )


def check_sizes(
    stated: bool, readings_mm: Floats, x_mm: Floats, y_mm: Floats, own_places: bool
) -> tuple[str, ...]:
    """Doubt sizes that no profilometer sees: another unit is likely.

    Parameters
    ----------
    stated
        Whether the file or the user states the unit of the readings.
    readings_mm, x_mm, y_mm
        Readings, and where the columns and rows are.
    own_places
        Whether the places are the file's own, so in its own unit, too.

    Returns
    -------
    doubts
        Note on implausible values despite a stated unit.

    Raises
    ------
    RecipeError
        Where it is odd and no one states the unit.
    """
    finite = readings_mm[np.isfinite(readings_mm)]
    span = float(np.quantile(finite, 0.995) - np.quantile(finite, 0.005))
    width = float(max(np.ptp(x_mm), np.ptp(y_mm) if y_mm.size else 0.0))
    doubt = ""
    if span > 0 and width > 0 and not LEAST_SPAN <= span / width <= MOST_SPAN:
        doubt = f"heights span {span:.4g} mm over a field of {width:.4g} mm"
    elif own_places and width > 0 and not LEAST_FIELD_MM <= width <= MOST_FIELD_MM:
        doubt = f"the field is {width:.4g} mm wide"
    if not doubt:
        return ()
    if stated:
        return (f"odd: {doubt}, in the unit stated",)
    raise RecipeError(
        f"states no unit, and in mm {doubt}",
        allowed="--unit (or --z-step-mm, --pitch-x-mm); --no-check where mm is right",
    )
