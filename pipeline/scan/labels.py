"""Labels of a scan in compiled passes: the flaw of each face, visibility, and counts."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Counts = NDArray[np.int64]
Labels = tuple[NDArray[np.uint8], NDArray[np.uint8]]


@njit(cache=True)
def flaws_hit(
    triangle: NDArray[np.int32], instance_of_face: NDArray[np.uint16]
) -> NDArray[np.uint16]:
    """Return the flaw (n, m) whose face each point hits, 0 = none.

    Parameters
    ----------
    triangle : (n, m)
        Face hit first, -1 = none.
    instance_of_face : (F,)
        Flaw of each face, 0 = the part's skin.
    """
    n, m = triangle.shape
    instance = np.zeros((n, m), dtype=np.uint16)
    for i in range(n):
        for j in range(m):
            face = triangle[i, j]
            if face >= 0:
                instance[i, j] = instance_of_face[face]
    return instance


@njit(cache=True)
def differ(
    instance: NDArray[np.uint16], depth_mm: Floats, clean_mm: Floats, same_mm: float
) -> NDArray[np.bool_]:
    """Return the points (n, m) on no flaw's face whose hit on the clean part is gone.

    Parameters
    ----------
    instance : (n, m)
        Flaw whose face is hit, 0 = none.
    depth_mm, clean_mm : (n, m)
        Depths on the flawed and on the clean part, NaN = missing reading.
    same_mm : float
        Depths closer than this are of the same surface.
    """
    n, m = instance.shape
    gone = np.empty((n, m), dtype=np.bool_)
    for i in range(n):
        for j in range(m):
            clean = clean_mm[i, j]
            same = np.isnan(clean) or abs(depth_mm[i, j] - clean) <= same_mm
            gone[i, j] = instance[i, j] == 0 and not same
    return gone


def stand_out(
    instance: NDArray[np.uint16],
    class_of_instance: NDArray[np.uint8],
    reading_mm: Floats,
    depth_mm: Floats,
    clean_mm: Floats,
    noise_mm: Floats,
    visible_at: float,
) -> Labels:
    """Give each point its class, and its class where the flaw can be told from the noise.

    A flaw is visible where the noise-free deviation exceeds `visible_at` standard deviations of the
    noise, or where only one of the two parts gives a reading. A missing reading shows only the
    latter.

    Returns
    -------
    mask, mask_visible : (n, m)
    """
    at = _places(instance)
    depth, clean, noise, reading = (
        values[at] for values in (depth_mm, clean_mm, noise_mm, reading_mm)
    )
    gone = np.isnan(depth) != np.isnan(clean)
    shown = gone | ((np.abs(depth - clean) > visible_at * noise) & ~np.isnan(reading))
    mask = np.zeros(instance.shape, dtype=np.uint8)
    visible = np.zeros(instance.shape, dtype=np.uint8)
    mask[at] = class_of_instance[instance[at]]
    visible[at] = np.where(shown, mask[at], 0)
    return mask, visible


@njit(cache=True)
def cross_boxes(from_mm: Floats, to_mm: Floats, boxes_mm: Floats) -> NDArray[np.bool_]:
    """Return which straight lines between points (k, 3) meet any of the boxes (b, 2, 3)."""
    out = np.zeros(len(from_mm), dtype=np.bool_)
    for i in range(len(from_mm)):
        for b in range(len(boxes_mm)):
            first, last = 0.0, 1.0
            for axis in range(3):
                start, way = from_mm[i, axis], to_mm[i, axis] - from_mm[i, axis]
                low, high = boxes_mm[b, 0, axis] - start, boxes_mm[b, 1, axis] - start
                if way == 0.0:
                    if low > 0.0 or high < 0.0:
                        first = 2.0
                    continue
                if way < 0.0:
                    low, high = high, low
                first, last = max(first, low / way), min(last, high / way)
            if first <= last:
                out[i] = True
                break
    return out


def _places(instance: NDArray[np.uint16]) -> tuple[Counts, Counts]:
    """Rows and columns of the points of flaws; numpy lists a flat mask's ten times faster."""
    return np.divmod(np.flatnonzero(instance != 0), instance.shape[1])


def boxes_of(instance: NDArray[np.uint16], flaws: int) -> list[tuple[slice, slice] | None]:
    """Return the profiles and points between which each of the flaws lies; None without any."""
    rows, columns = _places(instance)
    number = instance[rows, columns]
    boxes: list[tuple[slice, slice] | None] = []
    for flaw in range(1, flaws + 1):
        mine = np.flatnonzero(number == flaw)
        if not mine.size:
            boxes.append(None)
            continue
        first, last = (int(rows[mine[k]]) for k in (0, -1))
        left, right = int(columns[mine].min()), int(columns[mine].max())
        boxes.append((slice(first, last + 1), slice(left, right + 1)))
    return boxes


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Tally:
    """Counts of a scan's flaws; arrays are by instance (k + 1,), 0 is no flaw.

    Attributes
    ----------
    points, valid : int
        Points of the scan, and those with a reading.
    depth_mean_mm : float or None
        Mean reading.
    pixels, visible, hidden : int64
        Points of each flaw, those where it stands out, and those that the camera doesn't see.
    deviation_over_noise : float64
        Root of the mean square of the deviation over the noise where both parts return; NaN
        where they never do.
    """

    points: int
    valid: int
    depth_mean_mm: float | None
    pixels: Counts
    visible: Counts
    hidden: Counts
    deviation_over_noise: Floats


def tally(
    flaws: int,
    instance: NDArray[np.uint16],
    mask_visible: NDArray[np.uint8],
    reason: NDArray[np.uint8],
    hiding: tuple[int, int],
    reading_mm: Floats,
    depth_mm: Floats,
    clean_mm: Floats,
    noise_mm: Floats,
) -> Tally:
    """Count a scan's points, in all and flaw by flaw.

    Parameters
    ----------
    flaws
        Number of the specimen's flaws.
    instance, mask_visible, reason, reading_mm, depth_mm, clean_mm, noise_mm : (n, m)
        The scan, see `pipeline.scan.labelled_scan.Scan`.
    hiding
        The two reasons that say that the camera doesn't see a point.
    """
    valid, total = _valid_and_sum(reason, reading_mm)
    at = _places(instance)
    number, seen, why, flawed, clean, noise = (
        values[at] for values in (instance, mask_visible, reason, depth_mm, clean_mm, noise_mm)
    )
    off = (flawed - clean) / np.maximum(noise, 1e-9)
    finite = np.isfinite(off)
    pixels, visible, hidden, both = (
        np.bincount(chosen, minlength=flaws + 1)
        for chosen in (number, number[seen > 0], number[np.isin(why, hiding)], number[finite])
    )
    squares = np.bincount(number[finite], weights=off[finite] ** 2, minlength=flaws + 1)
    with np.errstate(invalid="ignore"):
        ratio = np.sqrt(squares / both)
    return Tally(
        points=reason.size,
        valid=valid,
        depth_mean_mm=total / valid if valid else None,
        pixels=pixels,
        visible=visible,
        hidden=hidden,
        deviation_over_noise=ratio,
    )


@njit(cache=True)
def _valid_and_sum(reason: NDArray[np.uint8], reading_mm: Floats) -> tuple[int, float]:
    """Return the number of valid points and the sum of their readings, row by row."""
    n, m = reason.shape
    valid, total = 0, 0.0
    for i in range(n):
        row = 0.0
        for j in range(m):
            if reason[i, j] == 0:
                valid += 1
                row += reading_mm[i, j]
        total += row
    return valid, total


@njit(cache=True)
def counts_of(
    depth_mm: Floats, scale_mm: float, first: int, missing: int, out: NDArray[np.unsignedinteger]
) -> None:
    """Write depths (n, m) as counts into `out`: round(depth / scale) - first, NaN = missing."""
    n, m = depth_mm.shape
    for i in range(n):
        for j in range(m):
            depth = depth_mm[i, j]
            if np.isnan(depth):
                out[i, j] = missing
            else:
                out[i, j] = min(max(np.rint(depth / scale_mm) - first, 0.0), missing - 1.0)
