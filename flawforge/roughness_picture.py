"""Picture of a surface's roughness: profile, heights, spectra, measured beside simulated."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from files.whole_file import whole
from sensors.noise.noise_target import NoiseTarget
from sensors.noise.spectrum import power_spectrum

Floats = NDArray[np.float64]

MEASURED, SIMULATED = "#1f4e79", "#d1651f"


def draw(
    flat: Floats, simulated: Floats | None, wanted: NoiseTarget, name: str, path: Path
) -> None:
    """Draw the four panels.

    Parameters
    ----------
    flat, simulated : (n, m) arrays
        Readings without form, mm; measured, and of the noise found (if it was solved).
    wanted : NoiseTarget
        Pitch and cut-off.
    name : str
        Title.
    path : Path
        PNG to write.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    scans = [(flat, "measured", MEASURED)]
    if simulated is not None:
        scans.append((simulated, "simulated", SIMULATED))
    figure = Figure(figsize=(11, 7), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, 2)
    scale, unit = (1000.0, "µm") if np.nanstd(flat) < 0.5 else (1.0, "mm")

    spread = 8.0 * float(np.nanstd(flat)) * scale
    for k, (scan, label, colour) in enumerate(scans):
        row = scan[scan.shape[0] // 2] * scale
        x_mm = np.arange(row.size) * wanted.pitch_x_mm
        axes[0, 0].plot(x_mm, row - k * spread, color=colour, lw=0.7, label=label)
    axes[0, 0].set(xlabel="along the profile, mm", ylabel=f"height, {unit}", title="one profile")

    every = np.concatenate([scan[np.isfinite(scan)] for scan, _, _ in scans]) * scale
    low, high = np.quantile(every, [0.0005, 0.9995])
    bins = np.linspace(float(low), float(high), 101)
    for scan, label, colour in scans:
        values = scan[np.isfinite(scan)] * scale
        axes[0, 1].hist(
            values, bins=bins, density=True, histtype="step", color=colour, label=label
        )
    axes[0, 1].set(xlabel=f"height, {unit}", ylabel="density", yscale="log", title="heights")

    for axis, pitch, panel, title in (
        (1, wanted.pitch_x_mm, axes[1, 0], "spectrum along the profiles"),
        (0, wanted.pitch_y_mm, axes[1, 1], "spectrum across the profiles"),
    ):
        if flat.shape[axis] < 16:
            panel.set_axis_off()
            continue
        for scan, label, colour in scans:
            frequency, density = power_spectrum(scan, pitch, axis)
            panel.loglog(frequency, density * scale**2, color=colour, lw=1.0, label=label)
        if wanted.cutoff_mm is not None:
            panel.axvline(1.0 / wanted.cutoff_mm, color="grey", lw=0.8, ls=":")
        panel.set(xlabel="cycles per mm", ylabel=f"{unit}²·mm", title=title)
    for panel in axes.flat:
        if panel.axison:
            panel.legend(frameon=False, fontsize=8)
    figure.suptitle(name)
    with whole(path) as aside:
        figure.savefig(aside, dpi=120)
