"""Axes and counters among the numbers of a table: what isn't a reading, though no name says so."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

LEAST = 4  # entries from which evenly spaced numbers are an axis and no chance
EVEN = 0.02
"""Largest departure of an axis from even spacing, in steps: axes are printed with two digits or
more behind the step."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Axes:
    """A table without its axes.

    Attributes
    ----------
    table : (n, m)
        The readings.
    x, y : (m,), (n,) or None
        Places in the first row and in the first column, in the file's own numbers.
    dropped : tuple of str
        What was taken for something else than readings.
    """

    table: Floats
    x: Floats | None
    y: Floats | None
    dropped: tuple[str, ...]


def without_axes(table: Floats) -> Axes:
    """Take the axes and counters off a table of numbers without names."""
    if table.shape[0] > LEAST and table.shape[1] > LEAST:
        x, y, corner = table[0, 1:], table[1:, 0], table[0, 0]
        interior = table[1:, 1:]
        free = not np.isfinite(corner) or corner == 0.0 or corner not in (x[0], y[0])
        if free and is_axis(x, interior) and is_axis(y, interior.T):
            return Axes(
                table=interior, x=x, y=y,
                dropped=("the first row and column are axes",),
            )  # fmt: skip
    if table.shape[0] > 2 * LEAST and table.shape[1] > LEAST:
        first, rest = table[:, 0], table[:, 1:]
        if is_counter(first) and not _whole(rest):
            return Axes(table=rest, x=None, y=None, dropped=("the first column counts the rows",))
        if is_axis(first, rest.T):
            return Axes(table=rest, x=None, y=first, dropped=("the first column is an axis",))
        if is_axis(table[0], table[1:]):
            return Axes(table=table[1:], x=table[0], y=None, dropped=("the first row is an axis",))
    return Axes(table=table, x=None, y=None, dropped=())


def is_axis(values: Floats, rows: Floats) -> bool:
    """Return whether numbers run evenly one way while the readings beside them don't.

    Parameters
    ----------
    values : (m,)
        The candidate.
    rows : (n, m)
        Rows beside it; on an evenly tilted plane they run as evenly, and the candidate is one of
        them unless it leaves their range.
    """
    if len(values) < LEAST or not even(values):
        return False
    near = rows[: max(3, len(rows) // 8)]
    like = sum(1 for row in near if np.isfinite(row).all() and even(row))
    if like > len(near) / 2:
        return False
    finite = near[np.isfinite(near)]
    if not finite.size:
        return True
    # Readings as even as an axis differ from row to row by less than from the axis.
    step = float(np.median(np.abs(np.diff(values))))
    with np.errstate(invalid="ignore"):
        between = np.nanmedian(np.abs(np.diff(near, axis=0))) if len(near) > 1 else 0.0
        away = np.nanmedian(np.abs(near[0] - values)) if near.shape[1] == len(values) else np.inf
    return bool(away > 3.0 * between or away > step * len(values) / 20)


def even(values: Floats) -> bool:
    """Return whether numbers rise or fall by equal steps, but for rounding."""
    if not np.isfinite(values).all():
        return False
    steps = np.diff(values)
    middle = float(np.mean(steps))
    return middle != 0.0 and bool(np.abs(steps - middle).max() <= max(EVEN, 1e-9) * abs(middle))


def is_counter(values: Floats) -> bool:
    """Return whether numbers count rows: 0, 1, 2 ... or 1, 2, 3 ..."""
    whole = np.isfinite(values).all() and np.array_equal(values, np.rint(values))
    return bool(whole) and values[0] in (0.0, 1.0) and bool((np.diff(values) == 1.0).all())


def _whole(values: Floats) -> bool:
    finite = values[np.isfinite(values)]
    return bool(np.array_equal(finite, np.rint(finite)))
