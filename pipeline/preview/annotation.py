"""What is drawn over pictures: colours of the kinds, a scale bar, axes, labels kept apart."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pipeline.preview.camera import Camera

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]

DARK = "#22252B"
COLOURS: Mapping[str, str] = {
    "dent": "#E69F00",
    "crack": "#D62728",
    "pit": "#8E44AD",
    "scratch": "#1F77B4",
    "bump": "#2CA02C",
    "edge_chip": "#17BECF",
    "edge_burr": "#7FBF3F",
    "corrosion": "#8C564B",
    "undercut": "#E377C2",
    "lack_of_fusion": "#B00060",
    "porosity": "#5B3FD6",
    "spatter": "#006D5B",
    "wear": "#BCBD22",
    "missing_feature": "#000000",
    "bank": "#FF5DA2",
    "flaw": "#D62728",
}


def colour_of(kind: str) -> str:
    """Return the colour of a kind of flaw."""
    return COLOURS.get(kind, COLOURS["flaw"])


def spread(labels: Floats, fixed: Floats, distance: float) -> Floats:
    """Push labels (k, 2) apart, and off the points `fixed`, until `distance` lies between them."""
    labels = labels + np.linspace(0, 1e-6, labels.size).reshape(labels.shape) * distance
    for _ in range(200):
        push = np.zeros_like(labels)
        for others, reach in ((labels, distance), (fixed, 0.75 * distance)):
            gap = labels[:, None] - others[None]
            length = np.linalg.norm(gap, axis=2)
            close = (length < reach) & (length > 0)
            share = np.where(close, (reach - length) / np.maximum(length, 1e-12), 0.0)
            push += (gap * share[..., None]).sum(axis=1) * 0.5
        labels = labels + push
        if np.abs(push).max() < 1e-3 * distance:
            break
    return np.asarray(labels)


def scale_bar(axes: "Axes", camera: Camera) -> None:
    """Draw a bar of a round length in the lower right corner."""
    left, right, bottom, top = camera.window_mm
    length = 0.24 * (right - left)
    round_mm = 10.0 ** np.floor(np.log10(length))
    length = float(max(step for step in (1, 2, 5) if step * round_mm <= length) * round_mm)
    end, level = right - 0.03 * (right - left), bottom + 0.035 * (top - bottom)
    bar = [end - length, end]
    for colour, width in (("white", 5.5), (DARK, 3)):
        axes.plot(bar, [level, level], color=colour, lw=width, solid_capstyle="butt", zorder=11)
    text = f"{length:g} mm" if length >= 0.1 else f"{length * 1000:g} µm"
    axes.text(
        end - length / 2, level + 0.012 * (top - bottom), text, ha="center", va="bottom",
        fontsize=9, zorder=10, bbox={"fc": "white", "ec": "none", "alpha": 0.7, "pad": 1.0},
    )  # fmt: skip


def triad(axes: "Axes", camera: Camera) -> None:
    """Draw the part frame's axes in the lower left corner."""
    left, right, bottom, top = camera.window_mm
    size = 0.055 * (right - left)
    origin = np.array([left + 1.5 * size, bottom + 1.4 * size])
    for name, axis, colour in zip("xyz", np.eye(3), ("#C0392B", "#27864A", "#2457A6"), strict=True):
        tip = camera.plane_mm(axis) * size
        axes.annotate(
            "", xy=tuple(origin + tip), xytext=tuple(origin), zorder=11,
            arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.6, "shrinkA": 0},
        )  # fmt: skip
        if np.linalg.norm(tip) > 0.2 * size:
            place = origin + tip * (1 + 0.32 * size / np.linalg.norm(tip))
            axes.text(
                float(place[0]), float(place[1]), name, color=colour, fontsize=10,
                ha="center", va="center", zorder=11,
            )  # fmt: skip
