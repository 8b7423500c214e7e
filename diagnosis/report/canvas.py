"""Figures of the report, as PNG bytes, and means over bins."""

import io
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from diagnosis.fields import Field

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INK = "#22303c"
PALE = "#b9c2c9"
BEFORE = "#c2452d"
AFTER = "#1f6f8b"
FEWEST = 5
"""Readings up to which a bin is left out."""


def figure_of(width: float, height: float, columns: int = 1) -> tuple["Figure", Any]:
    """Return a figure, inches, and its axes side by side."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(1, columns, squeeze=False)[0]
    for axis in axes:
        axis.tick_params(labelsize=8, colors=INK)
        for side in ("top", "right"):
            axis.spines[side].set_visible(False)
    return figure, axes


def png(figure: "Figure") -> bytes:
    """Return a figure as the bytes of a PNG file."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()


def binned(x: Field, y: Field, bins: int = 24) -> tuple[Field, Field, Field, Field]:
    """Mean of y over bins of x: centres, means, and their 95 % interval, (bins,) each.

    Bins lie half way between equal counts and equal widths; those of `FEWEST` values or fewer
    are left out.
    """
    which, size = _bins(x, bins)
    count = np.bincount(which, minlength=size)
    kept = count > FEWEST
    mean = np.bincount(which, weights=y, minlength=size)[kept] / count[kept]
    square = np.bincount(which, weights=y * y, minlength=size)[kept] / count[kept]
    error = 2 * np.sqrt(np.maximum(square - mean**2, 0) / count[kept])
    centre = np.bincount(which, weights=x, minlength=size)[kept] / count[kept]
    return centre, mean, mean - error, mean + error


def binned_medians(x: Field, y: Field, bins: int = 24) -> tuple[Field, Field, Field]:
    """Median of y over the same bins: centres, medians, counts, (bins,) each."""
    which, size = _bins(x, bins)
    found = [
        (x[which == k].mean(), np.median(y[which == k]), np.count_nonzero(which == k))
        for k in range(size)
        if np.count_nonzero(which == k) > FEWEST
    ]
    centre, median, count = np.array(found, dtype=np.float64).reshape(-1, 3).T
    return centre, median, count


def _bins(x: Field, bins: int) -> tuple[NDArray[np.intp], int]:
    """Return the bin of each value, and how many bins there are."""
    edges = np.unique(
        0.5 * np.quantile(x, np.linspace(0, 1, bins + 1))
        + 0.5 * np.linspace(x.min(), x.max(), bins + 1)
    )
    return np.clip(np.searchsorted(edges, x, side="right") - 1, 0, edges.size - 2), edges.size - 1
