"""The paper's figures 6, 7, 9 to 12 and the comparisons with real recordings, as PNG."""

import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from recordings import Outcome
from tables import TITLES, scans, unlimited, window_of

from sensors.noise.perlin import PerlinField
from sensors.noise.spectrum import power_spectrum
from sensors.noise.uncertainty import gaussian_sd_mm, quantise
from sensors.surface.surface import Surface

Floats = NDArray[np.float64]

HERE = Path(__file__).resolve().parent
BLUE, ORANGE, GREY = "#1f4e79", "#d1651f", "#7f7f7f"
NUMBERS = {"bearing_cap": 9, "car_door": 11, "steel_plate": 12}


def new(width: float, height: float) -> Figure:
    """Return an empty figure."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def door_scan() -> dict[str, Any]:
    """Generate the full scan of the door (figure6.yaml) and return its arrays."""
    from flawforge.dataset import open as open_dataset

    out = HERE.parents[1] / "out" / "paper-figure6"
    shutil.rmtree(out, ignore_errors=True)
    command = [sys.executable, "-m", "flawforge.cli", "generate", str(HERE / "figure6.yaml")]
    subprocess.run([*command, "--out", str(out)], check=True, stdout=subprocess.DEVNULL)
    scan = open_dataset(out)[0]
    shutil.rmtree(out, ignore_errors=True)
    return scan


def figure_6(scan: dict[str, Any]) -> None:
    """Draw the full scan as image and as point cloud."""
    depth = np.asarray(scan["depth"])
    x = scan["ray_x_mm"] + depth * scan["ray_slope"]
    y = np.linalg.norm(scan["pose"][:, :3, 3] - scan["pose"][0, :3, 3], axis=1)
    figure = new(12, 5)
    cloud, image = figure.add_subplot(1, 2, 1, projection="3d"), figure.add_subplot(1, 2, 2)
    rows, columns = slice(None, None, 16), slice(None, None, 24)
    z = depth[rows, columns]
    seen = np.isfinite(z)
    cloud.scatter(
        x[rows, columns][seen],
        np.broadcast_to(y[rows, None], z.shape)[seen],
        -z[seen],
        c=z[seen],
        s=1.2,
        cmap="viridis_r",
    )
    cloud.set(xlabel="x, mm", ylabel="travel, mm", zlabel="-depth, mm", title="point cloud")
    cloud.view_init(elev=60, azim=-60)
    cloud.set_zticks([-400, -390, -380, -370])
    drawn = image.imshow(depth, aspect="auto", cmap="viridis_r", interpolation="none")
    image.set(xlabel="point", ylabel="profile", title=f"depth, {depth.shape[0]} × {depth.shape[1]}")
    figure.colorbar(drawn, ax=image, label="depth, mm")
    figure.savefig(HERE / "figure-06.png", dpi=110)


def figure_7(scan: dict[str, Any]) -> None:
    """Draw one profile without noise, with equation 10, and with Perlin noise as well."""
    ideal = np.asarray(scan["depth_ideal"])
    handle = int(np.argmax(np.nanstd(np.diff(ideal[:, 1400:2700], axis=1), axis=1)))
    profile = ideal[handle]
    x = scan["ray_x_mm"] + profile * scan["ray_slope"]
    door = Surface.load("car_door")
    field = PerlinField(
        amplitude_mm=0.080,
        cell_x_mm=1.0 / door.pc_per_mm,
        cell_y_mm=1.0 / door.pc_per_mm,
    )
    rng = np.random.default_rng(7)
    gaussian = rng.normal(0.0, gaussian_sd_mm(0.015), profile.shape)
    speckle = field.sample(x, np.array([0.0]), rng)[0]
    readings = (
        ("no noise", profile),
        ("Gaussian, equation 10 with ΔZ = 15 µm", quantise(profile + gaussian, 0.015)),
        (
            "Gaussian and Perlin, amplitude 80 µm",
            quantise(profile + gaussian + speckle, 0.015),
        ),
    )
    middle = float(np.nanmedian(x)) + 90.0
    zoom = (x > middle) & (x < middle + 12.0)
    figure = new(11, 8)
    for panels, (title, values) in zip(figure.subplots(3, 2), readings, strict=True):
        panels[0].plot(x, values, color=BLUE, lw=0.6)
        panels[0].axvspan(x[zoom][0], x[zoom][-1], color=ORANGE, alpha=0.4)
        panels[0].set(title=title, ylabel="depth, mm")
        panels[1].plot(x[zoom], values[zoom], color=ORANGE, lw=0.8)
        panels[1].set_title("the part marked")
        low, high = np.nanmin(profile[zoom]), np.nanmax(profile[zoom])
        for panel in panels:
            panel.invert_yaxis()
            panel.set_xlabel("x, mm")
        panels[1].set_ylim(high + 0.08, low - 0.08)
    figure.savefig(HERE / "figure-07.png", dpi=110)


def surfaces() -> None:
    """Draw figures 9, 11 and 12: image and profile of equation 9 and of the calibrated noise."""
    for name, title in TITLES.items():
        surface = Surface.load(name)
        window = window_of(surface)
        models = (
            ("equation 9, normalised", surface.field(verbatim=True, normalised=True)),
            ("calibrated", surface.field()),
        )
        figure = new(10, 7)
        panels = figure.subplots(2, 2)
        assert surface.rp_mm is not None
        reach = 1000.0 * 1.1 * max(surface.rp_mm, surface.rv_mm or 0.0)
        width, height = window.points * window.pitch_x_mm, window.profiles * window.pitch_y_mm
        for k, (label, field) in enumerate(models):
            z = 1000.0 * scans(unlimited(field) if k == 0 else field, window, 1)[0]
            drawn = panels[0, k].imshow(
                z, extent=(0, width, height, 0), vmin=-reach, vmax=reach, cmap="gray", aspect="auto"
            )
            panels[0, k].set(title=label, xlabel="x, mm", ylabel="travel, mm")
            x = np.arange(window.points) * window.pitch_x_mm
            panels[1, k].plot(x, z[50], color=BLUE, lw=0.8)
            panels[1, k].set(ylim=(-reach, reach), xlabel="x, mm", ylabel="µm")
            for level in (1000.0 * surface.rp_mm, -1000.0 * (surface.rv_mm or 0.0)):
                panels[1, k].axhline(level, color=ORANGE, lw=0.8, ls=":")
        figure.colorbar(drawn, ax=panels[0, :], label="µm")
        figure.suptitle(f"{title}; dotted: Rp and Rv of the real scan")
        figure.savefig(HERE / f"figure-{NUMBERS[name]:02d}.png", dpi=110)


def figure_10() -> None:
    """Draw heights and their distributions: equation 9, calibrated, and a Gaussian of equal Rq."""
    from scipy.stats import norm

    figure = new(11, 9)
    for row, name in zip(figure.subplots(3, 2), TITLES, strict=True):
        surface = Surface.load(name)
        window = window_of(surface)
        assert surface.rq_mm is not None
        reach = 4.0 * 1000.0 * surface.rq_mm
        at = np.linspace(-reach, reach, 400)
        steps = max(3.8, reach / 60.0)
        bins = np.arange(-reach, reach + steps, steps) + steps / 2
        models = (
            (
                "equation 9, normalised",
                unlimited(surface.field(verbatim=True, normalised=True)),
                GREY,
            ),
            ("calibrated", surface.field(), ORANGE),
        )
        for label, field, colour in models:
            z = 1000.0 * np.concatenate([s.ravel() for s in scans(field, window)])
            row[0].hist(z, bins=bins, density=True, histtype="step", color=colour, label=label)
            row[1].plot(at, np.searchsorted(np.sort(z), at) / z.size, color=colour, label=label)
        gauss = norm(scale=1000.0 * surface.rq_mm)
        row[0].plot(at, gauss.pdf(at), color=BLUE, lw=0.8, ls="--", label="Gaussian, real Rq")
        row[1].plot(at, gauss.cdf(at), color=BLUE, lw=0.8, ls="--", label="Gaussian, real Rq")
        row[0].set(title=surface.name, xlabel="height, µm", ylabel="density")
        row[1].set(title=surface.name, xlabel="height, µm", ylabel="share below")
        row[0].legend(frameon=False, fontsize=8)
    figure.savefig(HERE / "figure-10.png", dpi=110)


def recording(outcome: Outcome) -> None:
    """Draw heights, distribution and spectra of an unseen half beside its simulation."""
    unit, scale = ("nm", 1e6) if np.nanstd(outcome.unseen) < 1e-3 else ("µm", 1e3)
    figure = new(13, 7)
    panels = figure.subplots(2, 3)
    real, simulated = outcome.unseen, outcome.simulated[0]
    high = 3.0 * scale * float(np.nanstd(real))
    for k, (label, scan) in enumerate((("real, unseen half", real), ("simulated", simulated))):
        if real.shape[0] > 1:
            panels[0, k].imshow(scan * scale, vmin=-high, vmax=high, cmap="gray", aspect="auto")
            panels[0, k].set(title=label, xlabel="point", ylabel="profile")
        else:
            panels[0, k].plot(scan[0] * scale, color=(BLUE, ORANGE)[k], lw=0.6)
            panels[0, k].set(title=label, xlabel="point", ylabel=unit)
    values = [s[np.isfinite(s)] * scale for s in (real, np.concatenate(outcome.simulated))]
    at = np.linspace(*np.quantile(values[0], (0.0005, 0.9995)), 300)
    for label, v, colour in zip(("real", "simulated"), values, (BLUE, ORANGE), strict=True):
        share = np.searchsorted(np.sort(v - v.mean()), at) / v.size
        panels[0, 2].plot(at, share, color=colour, label=label)
    panels[0, 2].set(title=f"distribution, KS {outcome.ks:.3f}", xlabel=unit)
    panels[0, 2].legend(frameon=False)
    wanted = outcome.wanted
    for axis, pitch, panel, title in (
        (1, wanted.pitch_x_mm, panels[1, 0], "spectrum along"),
        (0, wanted.pitch_y_mm, panels[1, 1], "spectrum across"),
    ):
        if real.shape[axis] < 16:
            panel.set_axis_off()
            continue
        for scan, colour in ((real, BLUE), (simulated, ORANGE)):
            frequency, density = power_spectrum(scan, pitch, axis)
            panel.loglog(frequency, density * scale**2, color=colour, lw=0.9)
        panel.axvline(1.0 / outcome.region.cutoff_mm, color=GREY, ls=":", lw=0.8)
        panel.set(title=title, xlabel="cycles per mm", ylabel=f"{unit}²·mm")
    for values_db, edges, colour, label in (
        (outcome.along_db, wanted.bands()[0], BLUE, "along"),
        (outcome.across_db, wanted.bands()[1], ORANGE, "across"),
    ):
        if values_db.size:
            centre = np.sqrt(edges[1:] * edges[:-1])
            panels[1, 2].semilogx(centre, values_db, "o-", color=colour, label=label, ms=3)
    panels[1, 2].axhspan(-3, 3, color=GREY, alpha=0.2)
    panels[1, 2].set(title="simulated over real, dB", xlabel="cycles per mm")
    panels[1, 2].legend(frameon=False)
    figure.suptitle(outcome.region.what)
    figure.savefig(HERE / f"real-{outcome.region.key}.png", dpi=100)
