"""Local relief: the reading minus form and waviness by a Gaussian filter."""

import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]
Band = tuple[slice, Floats]

CUTOFF_MM: Final = 8.0  # of the series of ISO 21920-3: a flaw 8 mm wide keeps half its height
ALPHA: Final = math.sqrt(math.log(2) / math.pi)  # ISO 16610-21: transmission 50 % at the cutoff
BLOCKS: Final = 4  # in a standard deviation of the window
TRUNCATED: Final = 3.0  # standard deviations at which the window ends
LEAST_ROWS: Final = 16  # blocks of a band
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
        blocks.means(one, 1) for one in (weight, weight * x, weight * x * x, height, height * x)
    )
    y = y[:, None]
    held, my, mx, hm, yy, xx, xy, hy, hx = blocks.means(
        np.stack([w, w * y, wx, h, w * y * y, wxx, wx * y, h * y, hx]), 0
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
        self._bands: list[list[Band]] = []
        self._neighbours: list[tuple[Indices, Indices, Floats]] = []
        for count, width in zip(shape, sigma, strict=True):
            block = max(1, int(width / BLOCKS))
            blocks = -(-count // block)
            self._bands.append(_bands(count, blocks, block, width / block))
            at = np.clip((np.arange(count) + 0.5) / block - 0.5, 0, blocks - 1)
            low = np.minimum(at.astype(np.intp), max(blocks - 2, 0))
            self._neighbours.append((low, np.minimum(low + 1, blocks - 1), at - low))

    def means(self, values: Floats, axis: int) -> Floats:
        """Return the Gaussian means of fields (..., n, m) along n or m, up to a factor.

        They are of sums over the axis's blocks.
        """
        bands = self._bands[axis]
        if axis == 0:
            return np.concatenate([band @ values[..., near, :] for near, band in bands], axis=-2)
        return np.concatenate([values[..., near] @ band.T for near, band in bands], axis=-1)

    def blended(self, values: Floats) -> Floats:
        """Return blocks' values at every reading, linear between the blocks' middles."""
        for axis, (low, high, share) in enumerate(self._neighbours):
            part = share.reshape((-1, 1) if axis == 0 else (1, -1))
            values = values.take(low, axis) * (1 - part) + values.take(high, axis) * part
        return values


def _bands(count: int, blocks: int, block: int, sigma: float) -> list[Band]:
    """Return the matrix of Gaussian means of blocks' sums, band by band.

    Each band has the readings that it needs and its rows: products of small full matrices take a
    quarter of a filter's time.
    """
    radius = int(TRUNCATED * sigma + 0.5)
    rows = max(LEAST_ROWS, 2 * radius)
    found = []
    for first in range(0, blocks, rows):
        last = min(first + rows, blocks)
        near = slice(max(0, first - radius) * block, min(count, (last + radius) * block))
        lag = np.arange(near.start, near.stop) // block - np.arange(first, last)[:, None]
        weight = np.exp(-0.5 * np.square(lag / sigma))
        found.append((near, np.where(np.abs(lag) <= radius, weight, 0.0)))
    return found
