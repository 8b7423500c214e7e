"""Figures of the report, as PNG bytes, and means over bins."""

import io
from typing import TYPE_CHECKING, Any

import numpy as np

from diagnosis.fields import Field

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INK = "#22303c"
PALE = "#b9c2c9"
BEFORE = "#c2452d"
AFTER = "#1f6f8b"


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

    Bins lie half way between equal counts and equal widths; those of 5 values or fewer are left
    out.
    """
    edges = np.unique(
        0.5 * np.quantile(x, np.linspace(0, 1, bins + 1))
        + 0.5 * np.linspace(x.min(), x.max(), bins + 1)
    )
    which = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, edges.size - 2)
    count = np.bincount(which, minlength=edges.size - 1)
    kept = count > 5
    mean = np.bincount(which, weights=y, minlength=edges.size - 1)[kept] / count[kept]
    square = np.bincount(which, weights=y * y, minlength=edges.size - 1)[kept] / count[kept]
    error = 2 * np.sqrt(np.maximum(square - mean**2, 0) / count[kept])
    centre = np.bincount(which, weights=x, minlength=edges.size - 1)[kept] / count[kept]
    return centre, mean, mean - error, mean + error
