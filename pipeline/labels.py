"""Labels of a scan in two compiled passes: whose face is hit, and whether it stands out."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Labels = tuple[NDArray[np.uint8], NDArray[np.uint8]]


@njit(cache=True)
def faces_hit(
    triangle: NDArray[np.int32],
    instance_of_face: NDArray[np.uint16],
    depth_mm: Floats,
    clean_mm: Floats,
    same_mm: float,
) -> tuple[NDArray[np.uint16], NDArray[np.int64]]:
    """Give each point the flaw whose face it hits, and list those to be asked further.

    Parameters
    ----------
    triangle : (n, m)
        Face hit first, -1 = none.
    instance_of_face : (F,)
        Flaw of each face, 0 = the part's skin.
    depth_mm, clean_mm : (n, m)
        Depths on the flawed and on the clean part, NaN = no return.
    same_mm : float
        Depths closer than this are of the same surface.

    Returns
    -------
    instance : (n, m)
    moved : (k,)
        Flat numbers of points on no flaw's face whose clean hit is gone.
    """
    n, m = triangle.shape
    instance = np.zeros((n, m), dtype=np.uint16)
    moved = np.empty(n * m, dtype=np.int64)
    count = 0
    for i in range(n):
        for j in range(m):
            face = triangle[i, j]
            if face >= 0 and instance_of_face[face] > 0:
                instance[i, j] = instance_of_face[face]
                continue
            clean = clean_mm[i, j]
            if not np.isnan(clean) and not abs(depth_mm[i, j] - clean) <= same_mm:
                moved[count] = i * m + j
                count += 1
    return instance, moved[:count].copy()


@njit(cache=True)
def stand_out(
    instance: NDArray[np.uint16],
    class_of_instance: NDArray[np.uint8],
    reading_mm: Floats,
    depth_mm: Floats,
    clean_mm: Floats,
    limit_mm: Floats,
) -> Labels:
    """Give each point its class, and its class where the flaw can be told from the noise.

    A flaw stands out where the noise-free deviation exceeds `limit_mm`, or where one of the two
    parts returns and the other doesn't; a reading that is missing tells nothing but the latter.

    Returns
    -------
    mask, mask_visible : (n, m)
    """
    n, m = instance.shape
    mask = np.zeros((n, m), dtype=np.uint8)
    visible = np.zeros((n, m), dtype=np.uint8)
    for i in range(n):
        for j in range(m):
            number = instance[i, j]
            if number == 0:
                continue
            mask[i, j] = class_of_instance[number]
            gone = np.isnan(depth_mm[i, j]) != np.isnan(clean_mm[i, j])
            off = abs(depth_mm[i, j] - clean_mm[i, j]) > limit_mm[i, j]
            if gone or (off and not np.isnan(reading_mm[i, j])):
                visible[i, j] = mask[i, j]
    return mask, visible


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
