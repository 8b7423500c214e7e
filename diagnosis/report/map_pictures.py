"""Maps of the recording with the largest mismatch: where it departs, residuals before and after."""

from typing import Any

import numpy as np

from diagnosis.diagnosis import Diagnosis
from diagnosis.fields import Mask
from diagnosis.localise.maps import RecordingMaps
from diagnosis.report.canvas import figure_of, png


def mismatch_map(result: Diagnosis) -> bytes:
    """Depth, and where it departs, of the recording with the largest mismatch."""
    maps = _worst(result)
    thin, extent = _thinned(maps.mask)
    figure, (axis,) = figure_of(5.6, 3.6)
    shown = axis.imshow(maps.depth_mm[thin], aspect="auto", cmap="Greys", extent=extent)
    figure.colorbar(shown, ax=axis, label="depth, mm", shrink=0.85)
    if maps.mask.any():
        overlay = np.zeros((*maps.mask[thin].shape, 4))
        overlay[maps.mask[thin]] = (0.76, 0.27, 0.18, 0.45)
        axis.imshow(overlay, aspect="auto", extent=extent, interpolation="nearest")
    title = f"{maps.name}\ndepth; red where it departs from the nominal model"
    axis.set_title(title, fontsize=9, parse_math=False)  # a file's name is no formula
    _name_axes(axis)
    return png(figure)


def residual_maps(result: Diagnosis) -> bytes:
    """Residuals of the recording with the largest mismatch, before and after, at one scale."""
    maps = _worst(result)
    thin, extent = _thinned(maps.mask)
    pair = [1e3 * (maps.depth_mm - m)[thin] for m in (maps.simulated, maps.explained)]
    known = np.abs(pair[0][np.isfinite(pair[0])])
    limit = float(np.quantile(known, 0.97)) if known.size else 1.0
    figure, axes = figure_of(10.5, 3.6, 2)
    for axis, residual, words in zip(
        axes, pair, ("nominal model", "with the effects found"), strict=True
    ):
        shown = axis.imshow(
            residual, aspect="auto", cmap="RdBu_r", vmin=-limit, vmax=limit, extent=extent,
            interpolation="nearest",
        )  # fmt: skip
        axis.set_title(f"residual, {words}", fontsize=9)
        _name_axes(axis)
    figure.colorbar(shown, ax=list(axes), label="reading - expectation, µm", shrink=0.85)
    return png(figure)


def _worst(result: Diagnosis) -> RecordingMaps:
    """Return the maps of the recording with the largest mismatch."""
    return max(result.maps, key=lambda m: float(m.mask.mean()))


def _thinned(mask: Mask) -> tuple[tuple[slice, slice], tuple[int, int, int, int]]:
    """Return slices to about 500 by 700 cells, and the extent of the whole map."""
    rows, columns = mask.shape
    step = max(1, rows // 500), max(1, columns // 700)
    return (slice(None, None, step[0]), slice(None, None, step[1])), (0, columns, rows, 0)


def _name_axes(axis: Any) -> None:
    axis.set_xlabel("point", fontsize=8)
    axis.set_ylabel("profile", fontsize=8)
