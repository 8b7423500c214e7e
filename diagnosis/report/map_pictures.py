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
    _bar(figure, shown, axis, "depth, mm")
    if maps.mask.any():
        overlay = np.zeros((*maps.mask[thin].shape, 4))
        overlay[maps.mask[thin]] = (0.76, 0.27, 0.18, 0.45)
        axis.imshow(overlay, aspect="auto", extent=extent, interpolation="nearest")
    title = f"{maps.name}\ndepth; red where it departs from the nominal model"
    axis.set_title(title, fontsize=9, parse_math=False)  # a file's name is no formula
    _name_axes(axis)
    return png(figure)


def residual_maps(result: Diagnosis) -> bytes:
    """Residuals of the recording with the largest mismatch, before and after, at one scale.

    One map where the effects found move no expectation.
    """
    maps = _worst(result)
    thin, extent = _thinned(maps.mask)
    pair = [1e3 * (maps.depth_mm - m)[thin] for m in (maps.simulated, maps.explained)]
    known = np.abs(pair[0][np.isfinite(pair[0])])
    limit = float(np.quantile(known, 0.97)) if known.size else 1.0
    words = ["before: nominal model", "after: with the effects found"]
    if not moves_expectation(result):
        pair, words = pair[:1], ["nominal model"]
    lost = (np.isfinite(maps.simulated) & ~np.isfinite(maps.depth_mm))[thin]
    black = np.zeros((*lost.shape, 4))
    black[lost, 3] = 1.0
    figure, axes = figure_of(5.6 if len(pair) == 1 else 10.5, 3.6, len(pair))
    for axis, residual, title in zip(axes, pair, words, strict=True):
        shown = axis.imshow(
            residual, aspect="auto", cmap="RdBu_r", vmin=-limit, vmax=limit, extent=extent,
            interpolation="nearest",
        )  # fmt: skip
        axis.imshow(black, aspect="auto", extent=extent, interpolation="nearest")
        axis.set_title(f"residual, {title}", fontsize=9)
        _name_axes(axis)
    _bar(figure, shown, list(axes), "reading - expectation, µm")
    return png(figure)


def moves_expectation(result: Diagnosis) -> bool:
    """Whether the effects found move the expectation of any reading that the maps show."""
    maps = _worst(result)
    return not np.array_equal(maps.simulated, maps.explained, equal_nan=True)


def _bar(figure: Any, shown: Any, axes: Any, label: str) -> None:
    bar = figure.colorbar(shown, ax=axes, shrink=0.85)
    bar.set_label(label, fontsize=8)
    bar.ax.tick_params(labelsize=8)


def _worst(result: Diagnosis) -> RecordingMaps:
    """Return the maps of the recording with the largest mismatch."""
    return max(result.maps, key=lambda m: float(m.mask.mean()))


def _thinned(mask: Mask) -> tuple[tuple[slice, slice], tuple[int, int, int, int]]:
    """Return slices to about 500 by 700 cells, and the extent of the whole map."""
    rows, columns = mask.shape
    step = max(1, rows // 500), max(1, columns // 700)
    return (slice(None, None, step[0]), slice(None, None, step[1])), (0, columns, rows, 0)


def _name_axes(axis: Any) -> None:
    axis.set_xlabel("point of the profile", fontsize=8)
    axis.set_ylabel("profile", fontsize=8)
