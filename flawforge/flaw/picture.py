"""Picture of a flaw taken out of a recording: heights as read, its relief, and two sections."""

from pathlib import Path

import numpy as np

from files.whole_file import whole
from flawforge.flaw.extraction import Extracted

RAW, RELIEF, SKIN = "#8AA4BF", "#B3321E", "#22252B"


def draw(found: Extracted, path: Path) -> None:
    """Write the picture; heights in µm over the part's skin."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    relief = found.relief
    heights, raw = 1e3 * relief.height_mm, 1e3 * found.raw_mm
    limit = float(np.abs(heights).max())
    figure = Figure(figsize=(10.5, 6.4), dpi=100, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, 2)
    rows, columns = (n * p for n, p in zip(raw.shape, found.pitch_mm, strict=True))
    shown = axes[0, 0].imshow(
        raw, extent=(0, columns, rows, 0), cmap="RdBu_r", vmin=-limit, vmax=limit
    )
    axes[0, 0].set_title("as read, levelled", fontsize=10)
    axes[0, 0].set(xlabel="along the laser line, mm", ylabel="along the travel, mm")
    half = [relief.pitch_mm * (n - 1) / 2 for n in heights.shape]
    along, across = (np.linspace(-h, h, n) for h, n in zip(half, heights.shape, strict=True))
    axes[0, 1].imshow(
        heights.T, extent=(-half[0], half[0], -half[1], half[1]), origin="lower", cmap="RdBu_r",
        vmin=-limit, vmax=limit,
    )  # fmt: skip
    axes[0, 1].contour(along, across, relief.mask.T, levels=[0.5], colors=SKIN, linewidths=0.8)
    size = relief.dimensions()
    axes[0, 1].set_title(
        f"relief: {size['length_mm']:.3g} x {size['width_mm']:.3g} mm, "
        f"{1e3 * size['depth_mm']:.3g} µm deep, {1e3 * size['height_mm']:.3g} µm high", fontsize=10,
    )  # fmt: skip
    axes[0, 1].set(xlabel="along the flaw, mm", ylabel="across, mm")
    figure.colorbar(shown, ax=axes[0, :], label="height, µm", shrink=0.8)
    row, column = np.unravel_index(np.argmax(np.abs(heights)), heights.shape)
    for place, at, cut in (
        (axes[1, 0], along, heights[:, column]), (axes[1, 1], across, heights[row])
    ):  # fmt: skip
        place.axhline(0.0, color=SKIN, linewidth=0.7)
        place.axhspan(
            -2e3 * found.noise.sd_mm, 2e3 * found.noise.sd_mm, color=RAW, alpha=0.35, linewidth=0,
            label="two standard deviations of the noise",
        )  # fmt: skip
        place.plot(at, cut, color=RELIEF, linewidth=1.4, label="relief")
        place.set_ylabel("height, µm")
    axes[1, 0].set_xlabel("along the flaw through its extreme, mm")
    axes[1, 1].set_xlabel("across the flaw through its extreme, mm")
    axes[1, 1].legend(fontsize=8, frameon=False)
    figure.suptitle(f"{relief.name}, from {relief.facts.get('recording', 'a recording')}")
    with whole(path) as aside:
        figure.savefig(aside)
