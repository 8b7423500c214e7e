"""Local relief: the reading minus form and waviness by a Gaussian filter."""

import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

CUTOFF_MM: Final = 8.0  # of the series of ISO 21920-3: a flaw 8 mm wide keeps half its height
ALPHA: Final = math.sqrt(math.log(2) / math.pi)  # ISO 16610-21: transmission 50 % at the cutoff
BLOCKS: Final = 4  # in a standard deviation of the window
RANK_SHARE: Final = 1e-6  # below, in units of the window, too few readings for a plane


def pitch_mm(scan: Mapping[str, Any]) -> tuple[float, float]:
    """Return the distance between profiles and between points at the scan's median depth, mm.

    Parameters
    ----------
    scan
        Arrays `depth` (mm, NaN = missing), `pose`, `ray_x_mm`, `ray_slope`.
    """
    depth = np.asarray(scan["depth"], dtype=np.float64)
    typical = float(np.nanmedian(depth)) if np.isfinite(depth).any() else 0.0
    x = np.sort(scan["ray_x_mm"] + typical * scan["ray_slope"])
    steps = np.linalg.norm(np.diff(scan["pose"][:, :3, 3], axis=0), axis=1)
    return float(np.median(steps)), float(np.median(np.diff(x)))


def local_relief(
    depth_mm: Floats, pitch_yx_mm: tuple[float, float], cutoff_mm: float = CUTOFF_MM
) -> Floats:
    """Return the height above the waviness, mm, positive towards the sensor; NaN = missing.

    The waviness is a Gaussian regression filter of order 1 (ISO 16610-21 for the weights,
    ISO 16610-28 for the regression): in each window a plane is fitted with Gaussian weights, so
    that a tilted part has no relief, at borders and beside missing readings neither.

    Parameters
    ----------
    depth_mm : (n, m) float64
        Depths, NaN = missing.
    pitch_yx_mm
        Distance between profiles and between points, mm.
    cutoff_mm
        Wavelength that passes by half, mm.
    """
    valid = np.isfinite(depth_mm)
    if not valid.any():
        return np.full(depth_mm.shape, np.nan)
    sigma = [
        min(ALPHA * cutoff_mm / math.sqrt(2 * math.pi) / max(pitch, 1e-9), float(count))
        for pitch, count in zip(pitch_yx_mm, depth_mm.shape, strict=True)
    ]
    height = np.where(valid, np.median(depth_mm[valid]) - depth_mm, 0.0)
    # in units of the window's width, from the scan's middle: well conditioned
    y, x = (
        (np.arange(count, dtype=np.float64) - count / 2) / width
        for count, width in zip(depth_mm.shape, sigma, strict=True)
    )
    blocks = _Blocks(depth_mm.shape, (sigma[0], sigma[1]))
    level, slope_y, slope_x = (blocks.blended(one) for one in _planes(blocks, valid, height, y, x))
    return np.where(valid, height - (level + slope_y * y[:, None] + slope_x * x), np.nan)


def _planes(
    blocks: "_Blocks", valid: NDArray[np.bool_], height: Floats, y: Floats, x: Floats
) -> tuple[Floats, Floats, Floats]:
    """Return the planes fitted around each block's middle: height at y = x = 0, and the slopes."""
    weight = valid.astype(np.float64)
    # along x once for each power of x, then along y
    w, wx, wxx, h, hx = (
        blocks.mean(one, 1) for one in (weight, weight * x, weight * x * x, height, height * x)
    )
    y = y[:, None]
    held, my, mx, hm, yy, xx, xy, hy, hx = (
        blocks.mean(one, 0) for one in (w, w * y, wx, h, w * y * y, wxx, wx * y, h * y, hx)
    )
    held = np.maximum(held, 1e-300)
    my, mx, hm = my / held, mx / held, hm / held
    yy, xx, xy = yy / held - my**2, xx / held - mx**2, xy / held - mx * my
    hy, hx = hy / held - my * hm, hx / held - mx * hm
    determinant = yy * xx - xy**2
    flat = determinant < RANK_SHARE
    determinant = np.where(flat, 1.0, determinant)
    slope_y = np.where(flat, 0.0, (hy * xx - hx * xy) / determinant)
    slope_x = np.where(flat, 0.0, (hx * yy - hy * xy) / determinant)
    return hm - slope_y * my - slope_x * mx, slope_y, slope_x


class _Blocks:
    """Blocks of readings a quarter of the window's width wide, and Gaussian means of them.

    Planes are fitted around blocks and blended linearly between them. Readings on a plane give
    that plane everywhere, and so the plane itself.
    """

    def __init__(self, shape: tuple[int, ...], sigma: tuple[float, float]) -> None:
        self._blocks = [max(1, int(width / BLOCKS)) for width in sigma]
        self._sigma = [width / block for width, block in zip(sigma, self._blocks, strict=True)]
        self._shape = shape

    def mean(self, values: Floats, axis: int) -> Floats:
        """Return the Gaussian means along an axis of sums over its blocks, up to a factor."""
        from scipy.ndimage import gaussian_filter1d

        block, sigma = self._blocks[axis], self._sigma[axis]
        if block > 1:
            values = np.add.reduceat(values, np.arange(0, self._shape[axis], block), axis=axis)
        return np.asarray(
            gaussian_filter1d(values, sigma, axis=axis, mode="constant", truncate=3.0)
        )

    def blended(self, values: Floats) -> Floats:
        """Return blocks' values at every reading, linear between the blocks' middles."""
        for axis, block in enumerate(self._blocks):
            at = (np.arange(self._shape[axis]) + 0.5) / block - 0.5
            at = np.clip(at, 0, values.shape[axis] - 1)
            low = np.minimum(at.astype(np.intp), max(values.shape[axis] - 2, 0))
            share = (at - low).reshape((-1, 1) if axis == 0 else (1, -1))
            high = np.minimum(low + 1, values.shape[axis] - 1)
            values = values.take(low, axis) * (1 - share) + values.take(high, axis) * share
        return values
