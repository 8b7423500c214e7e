"""Tables 2 to 4 of the paper, its readings and its pitches: numbers for docs/paper.md."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sensors.noise.calibration import calibrate
from sensors.noise.noise_target import NoiseTarget, simulate
from sensors.noise.perlin import PerlinField
from sensors.surface.roughness import FIGURES, profile_roughness, roughness
from sensors.surface.surface import Surface

Floats = NDArray[np.float64]

SEEDS = 10
SYMBOLS = ("Ra, mm", "Rq, mm", "Rp, mm", "Rv, mm", "Rpm, mm", "Rvm, mm", "Pc, 1/mm")
TITLES = {
    "bearing_cap": "Table 2, bearing cap",
    "car_door": "Table 3, car door",
    "steel_plate": "Table 4, heavy steel plate",
}
PAPERS_SIMULATION = {
    "bearing_cap": (0.0208, 0.0263, 0.0764, 0.0790, 0.0702, 0.0741, 4.62),
    "car_door": (0.0137, 0.0173, 0.0542, 0.0555, 0.0482, 0.0504, 6.2403),
    "steel_plate": (0.2403, 0.3058, 0.9633, 0.9642, 0.8550, 0.8817, 6.2279),
}
PAPERS_ERRORS = {
    "bearing_cap": (1.29, 0.11, 4.47, 6.55, 3.76, 5.85, 5.74),
    "car_door": (2.03, 2.47, 3.65, 6.28, 3.50, 5.73, 4.97),
    "steel_plate": (3.27, 1.94, 2.52, 1.95, 2.65, 1.22, 9.43),
}


def window_of(surface: Surface, **changes: Any) -> NoiseTarget:
    """Return the paper's window at the surface's pitch."""
    assert surface.pitch_x_mm is not None
    assert surface.pitch_y_mm is not None
    window = NoiseTarget(pitch_x_mm=surface.pitch_x_mm, pitch_y_mm=surface.pitch_y_mm)
    return replace(window, **changes)


def scans(field: PerlinField, window: NoiseTarget, seeds: int = SEEDS) -> list[Floats]:
    """Draw scans with seeds that no calibration uses."""
    return [
        simulate(field, window, np.random.default_rng([s, 2]), np.random.default_rng([s, 3]))
        for s in range(seeds)
    ]


def figures_of(field: PerlinField, window: NoiseTarget, seeds: int = SEEDS) -> Floats:
    """Return the seven figures of each scan, (seeds, 7)."""
    return np.array(
        [roughness(z, window.pitch_x_mm).values() for z in scans(field, window, seeds)]
    )


def real_figures(surface: Surface) -> Floats:
    """Return the surface's figures in the order of the tables."""
    return np.array([getattr(surface, name) for name in FIGURES])


def unlimited(field: PerlinField) -> PerlinField:
    """Return the field with all its octaves, aliased or not: as the text states."""
    return replace(field, band_limited=False)


def papers_tables() -> tuple[list[str], dict[str, Floats]]:
    """Return the three tables as Markdown, and our errors by model, (3, 7) in per cent."""
    lines: list[str] = []
    errors: dict[str, list[Floats]] = {"verbatim": [], "normalised": [], "calibrated": []}
    for name, title in TITLES.items():
        surface = Surface.load(name)
        real, window = real_figures(surface), window_of(surface)
        models = {
            "verbatim": unlimited(surface.field(verbatim=True)),
            "normalised": unlimited(surface.field(verbatim=True, normalised=True)),
            "calibrated": surface.field(),
        }
        found = {key: figures_of(field, window) for key, field in models.items()}
        for key, values in found.items():
            errors[key].append(100.0 * (values.mean(axis=0) / real - 1.0))
        lines += [
            f"### {title}",
            "",
            "| figure | real | paper's simulation | verbatim | verbatim, normalised | calibrated |"
            " error: paper | verbatim | normalised | **calibrated** |",
            "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
        ]
        for k, symbol in enumerate(SYMBOLS):
            cells = [
                f"{values[:, k].mean():.4g} ± {values[:, k].std(ddof=1):.2g}"
                for values in found.values()
            ]
            missed = [f"{errors[key][-1][k]:+.1f} %" for key in errors]
            lines.append(
                f"| {symbol} | {real[k]:g} | {PAPERS_SIMULATION[name][k]:g} | {cells[0]} |"
                f" {cells[1]} | {cells[2]} | {PAPERS_ERRORS[name][k]:.2f} % |"
                f" {missed[0]} | {missed[1]} | **{missed[2]}** |"
            )
        lines.append("")
    return lines, {key: np.array(value) for key, value in errors.items()}


def summary(errors: dict[str, Floats]) -> list[str]:
    """Return mean and worst error over the 21 cells of each model as Markdown."""
    lines = ["| model | mean error, 21 cells | worst cell |", "| --- | ---: | ---: |"]
    paper = np.array(list(PAPERS_ERRORS.values()))
    lines.append(f"| the paper's simulation | {paper.mean():.2f} % | {paper.max():.2f} % |")
    names = {
        "verbatim": "equation 9 as published, unit gradients",
        "normalised": "equation 9, each octave scaled to reach ±1",
        "calibrated": "**calibrated**",
    }
    for key, name in names.items():
        e = np.abs(errors[key])
        lines.append(f"| {name} | {e.mean():.2f} % | {e.max():.2f} % |")
    return lines


def readings() -> list[str]:
    """Compare definitions of Rpm and Pc on the paper's model with the published figures."""
    lines = [
        "| surface | points | Rq, mm | Rp/Rq | Rpm/Rp: readings | local maxima | five sections |"
        " Pc: every peak | 10 % as height | 10 % as distance in mm |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    for name in TITLES:
        surface = Surface.load(name)
        _, rq, rp, _, rpm, _, pc = PAPERS_SIMULATION[name]
        lines.append(
            f"| {surface.name}: **published** | | {rq:g} | {rp / rq:.2f} | **{rpm / rp:.3f}** | | |"
            f" **{pc:.2f}** | | |"
        )
        field = unlimited(surface.field(verbatim=True, normalised=True))
        for points in (501, 4096):
            window = window_of(surface, points=points)
            rows = np.concatenate(scans(field, window, 4))
            each = profile_roughness(rows, window.pitch_x_mm).mean(axis=0)
            level = rows - rows.mean(axis=1, keepdims=True)
            maxima = highest_maxima(level)
            sections = np.mean([p.max(axis=1) for p in np.array_split(level, 5, axis=1)])
            by_height = profile_roughness(rows, window.pitch_x_mm, peak_height_share=0.1)
            lines.append(
                f"| our draw | {points} | {each[1]:.4f} | {each[2] / each[1]:.2f} |"
                f" {each[4] / each[2]:.3f} | {maxima / each[2]:.3f} | {sections / each[2]:.3f} |"
                f" {each[6]:.2f} | {by_height[:, 6].mean():.2f} |"
                f" {_spaced_peaks(level, window.pitch_x_mm):.2f} |"
            )
    return lines


def highest_maxima(level: Floats) -> float:
    """Return the mean of the ten highest local maxima, averaged over profiles without mean."""
    from scipy.signal import find_peaks

    return float(np.mean([np.sort(row[find_peaks(row)[0]])[-10:].mean() for row in level]))


def _spaced_peaks(level: Floats, pitch_mm: float) -> float:
    from scipy.signal import find_peaks

    count = 0
    for row in level:
        distance = max(1, int(np.floor(0.1 * row.max() / pitch_mm)) + 1)
        count += len(find_peaks(row, distance=distance)[0])
    return count / (level.size * pitch_mm)


def other_readings() -> list[str]:
    """Return what the calibrated noise gives under the readings that were not taken."""
    lines = [
        "| surface | Rpm of local maxima | Rvm of local minima | Pc by height |"
        " Pc without plateaus |",
        "| --- | ---: | ---: | ---: | ---: |",
    ]
    for name in TITLES:
        surface = Surface.load(name)
        window = window_of(surface)
        rows = np.concatenate(scans(surface.field(), window))
        level = rows - rows.mean(axis=1, keepdims=True)
        by_height = profile_roughness(rows, window.pitch_x_mm, peak_height_share=0.1)[:, 6].mean()
        rises = np.diff(rows, axis=1)
        plain = ((rises[:, :-1] > 0) & (rises[:, 1:] < 0)).sum() / (rows.size * window.pitch_x_mm)
        values = (
            highest_maxima(level) / surface.rpm_mm,
            highest_maxima(-level) / surface.rvm_mm,
            by_height / surface.pc_per_mm,
            plain / surface.pc_per_mm,
        )
        lines.append(
            f"| {surface.name} | " + " | ".join(f"{100 * (v - 1):+.1f} %" for v in values) + " |"
        )
    return lines


def pitches() -> list[str]:
    """Return figures to expect at other pitches and with a coarser sensor, as Markdown."""
    lines = [
        "| surface | pitch, mm | ΔZ, µm | octaves drawn | " + " | ".join(SYMBOLS) + " |",
        "| --- | ---: | ---: | ---: |" + " ---: |" * 7,
    ]
    for name in TITLES:
        surface = Surface.load(name)
        window = window_of(surface)
        own = window.pitch_x_mm, window.pitch_y_mm
        for pitch, step in (
            (own, 3.8),
            (own, 15.0),
            ((0.1209, 0.2), 3.8),
            ((0.0225, 0.1), 3.8),
        ):
            other = replace(
                window, pitch_x_mm=pitch[0], pitch_y_mm=pitch[1], resolution_mm=step / 1000.0
            )
            found = figures_of(surface.field(), other, 5).mean(axis=0)
            drawn = len(surface.field().drawn_octaves(*pitch))
            lines.append(
                f"| {surface.name} | {pitch[0]:.4f} × {pitch[1]:g} | {step:g} | {drawn} | "
                + " | ".join(f"{v:.4g}" for v in found)
                + " |"
            )
    return lines


def three_figures() -> list[str]:
    """Return the seven figures that follow from Rpm, Rvm and Pc alone, as Markdown."""
    lines = [
        "| surface | " + " | ".join(symbol.split(",")[0] for symbol in SYMBOLS) + " |",
        "| --- |" + " ---: |" * 7,
    ]
    for name in TITLES:
        surface = Surface.load(name)
        wanted = window_of(
            surface, rpm_mm=surface.rpm_mm, rvm_mm=surface.rvm_mm, pc_per_mm=surface.pc_per_mm
        )
        found = figures_of(calibrate(wanted).field, wanted).mean(axis=0)
        errors = 100.0 * (found / real_figures(surface) - 1.0)
        lines.append(f"| {surface.name} | " + " | ".join(f"{e:+.1f} %" for e in errors) + " |")
    return lines


def beat() -> tuple[float, float]:
    """Return the swing of a row's variance over the scan, 98 control points on 100 profiles.

    Without and with the band limit, as share of the mean.
    """
    x, y = np.arange(501) * 22.5 / 501, np.arange(100) * 22.5 / 100
    swings = []
    for limited in (False, True):
        field = PerlinField(
            amplitude_mm=1.0,
            cell_x_mm=22.5 / 98,
            cell_y_mm=22.5 / 98,
            band_limited=limited,
            aligned=not limited,
        )
        rows = np.mean(
            [field.sample(x, y, np.random.default_rng([s, 4])).var(axis=1) for s in range(40)],
            axis=0,
        )
        wave = np.exp(-2j * np.pi * np.arange(100) / 50)
        swings.append(float(2.0 * abs(np.mean(rows * wave)) / rows.mean()))
    return swings[0], swings[1]
