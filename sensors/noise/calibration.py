"""Perlin noise solved so that what is *measured* on the simulated scan is what was wanted.

The paper sets the noise's parameters equal to figures of the surface (section 2.2.2) and measures
what comes out. Here the parameters (height map, control points along and across, persistence) are
solved: fields are drawn with fixed seeds, the sensor's uncertainty is added and rounded (equation
10), the figures are taken as a user would take them, and a damped Gauss-Newton iteration with the
same random numbers throughout moves the parameters until they agree.

The map has 18 free slopes, many more than there are figures. Of all maps that reach the figures
one is taken that keeps the heights close to a Gaussian (or, of a recording, to its own heights).
Every step is deterministic: same inputs, same parameters.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from sensors.noise.heights import HeightMap
from sensors.noise.noise_target import NoiseTarget, distribution
from sensors.noise.perlin import GRID_LIMIT, PerlinField
from sensors.noise.uncertainty import gaussian_sd_mm, quantise
from sensors.surface.form import remove_form
from sensors.surface.roughness import FIGURES, Roughness, roughness

Floats = NDArray[np.float64]

METHOD = 3
"""Raised whenever the same inputs would give other parameters."""

SIDE = (0.0, 0.5, 1.0, 1.4, 1.8, 2.1, 2.4, 2.7, 3.0, 3.4)
KNOTS = np.array([-k for k in SIDE[:0:-1]] + list(SIDE))
MIDDLE = len(SIDE) - 1
SLOPES = KNOTS.size - 1
BEYOND = 6.0

FIRST_SEED = 7_624_2023
"""Seeds of the calibration's own fields; a dataset's never start there."""

SPECTRUM_WEIGHT = 0.05
QUANTILE_WEIGHT = 0.3
FINE_POINTS, COARSE_POINTS = 400_000, 100_000
STRAIGHTNESS = (0.07, 0.06, 0.05)
BEND = 0.003
GOOD_ENOUGH = 0.01


@dataclass(frozen=True, kw_only=True, slots=True)
class Solution:
    """The noise found, what it measures in the calibration's own fields, and its worst error."""

    field: PerlinField
    reached: Roughness
    worst_error: float


class _Bench:
    """Simulated windows with fixed random numbers, and the residuals of parameters on them.

    Parameters are the logarithms of the map's slopes, then log cell_x, log cell_y, logit of the
    persistence.
    """

    def __init__(self, wanted: NoiseTarget, octaves: int, points: int) -> None:
        self.wanted = wanted
        self.octaves = octaves
        self.windows = int(np.clip(points // (wanted.profiles * wanted.points), 1, 40))
        self.both = wanted.spectrum_across is not None
        figures = wanted.figures()
        self.targets = np.log(list(figures.values()))
        self.columns = [FIGURES.index(name) for name in figures]
        sigma = gaussian_sd_mm(wanted.resolution_mm, wanted.repeatability_mm)
        shape = (wanted.profiles, wanted.points)
        self.gaussian = []
        for w in range(self.windows):
            rng = np.random.default_rng([FIRST_SEED, w, 1])
            # a part's depth falls anywhere between two multiples of the resolution
            depth = rng.random((shape[0], 1)) * wanted.resolution_mm
            self.gaussian.append(rng.normal(0.0, sigma, shape) + depth)
        self._fields: dict[tuple[float, ...], list[Floats]] = {}

    def noise(self, p: Floats, offset_mm: float = 0.0) -> PerlinField:
        """Return the field of these parameters."""
        heights = np.concatenate(([0.0], np.cumsum(np.exp(p[:SLOPES]) * np.diff(KNOTS))))
        heights -= heights[MIDDLE] + offset_mm
        cell_x, cell_y, persistence = self._lattice(p)
        return PerlinField(
            amplitude_mm=1.0,
            cell_x_mm=cell_x,
            cell_y_mm=cell_y,
            octaves=self.octaves,
            persistence=persistence,
            heights=HeightMap(
                knots=tuple(float(k) for k in KNOTS), values=tuple(float(h) for h in heights)
            ),
        )

    def _lattice(self, p: Floats) -> tuple[float, float, float]:
        cell_x = math.exp(p[SLOPES])
        cell_y = math.exp(p[SLOPES + 1]) if self.both else cell_x
        return cell_x, cell_y, 1.0 / (1.0 + math.exp(-p[SLOPES + 2]))

    def _standardised(self, p: Floats) -> list[Floats]:
        """Fields before the height map; kept for the last lattice, which the map doesn't touch."""
        key = self._lattice(p)
        if key not in self._fields:
            identity = HeightMap(knots=(-1.0, 1.0), values=(-1.0, 1.0))
            noise = replace(self.noise(p), heights=identity)
            if len(self._fields) > 1:
                self._fields.pop(next(iter(self._fields)))
            self._fields[key] = [
                noise.sample(*self.wanted.grid(), np.random.default_rng([FIRST_SEED, w, 0]))
                for w in range(self.windows)
            ]
        return self._fields[key]

    def figures(self, p: Floats) -> tuple[Floats, list[Floats]]:
        """Measure the seven figures on all windows; also return the windows without form."""
        heights = self.noise(p).heights
        assert heights is not None
        rows, flats = [], []
        for u, gaussian in zip(self._standardised(p), self.gaussian, strict=True):
            readings = quantise(heights(u) + gaussian, self.wanted.resolution_mm)
            flat = remove_form(readings, self.wanted.pitch_x_mm, self.wanted.cutoff_mm)
            rows.append(roughness(flat, self.wanted.pitch_x_mm).values())
            flats.append(flat)
        return np.mean(rows, axis=0), flats

    def residuals(self, p: Floats) -> Floats:
        """Return log errors of the figures, then of quantiles and spectra where they are wanted."""
        figures, flats = self.figures(p)
        parts = [np.log(figures[self.columns]) - self.targets]
        wanted = self.wanted
        if wanted.quantiles_mm is not None:
            found = [distribution(wanted, flat) for flat in flats]
            quantiles = np.array(wanted.quantiles_mm)
            scale = QUANTILE_WEIGHT / max(float(np.ptp(quantiles)), 1e-12)
            parts.append(scale * (np.mean([f[0] for f in found], axis=0) - quantiles))
            for k, target in ((1, wanted.spectrum_along), (2, wanted.spectrum_across)):
                if target is not None:
                    ratio = np.log(np.mean([f[k] for f in found], axis=0) / np.array(target))
                    parts.append(SPECTRUM_WEIGHT * np.nan_to_num(ratio) / math.sqrt(ratio.size / 4))
        return np.concatenate(parts)

    def worst_error(self, p: Floats) -> float:
        """Return the largest relative error of a wanted figure."""
        figures, _ = self.figures(p)
        return float(np.max(np.abs(figures[self.columns] / np.exp(self.targets) - 1.0)))

    def finished(self, p: Floats) -> PerlinField:
        """Return the field with its mean taken out, so that it shifts no depth, and safe ends.

        Few of the calibration's points lie beyond the last knots and many of a large scan's do:
        there the map goes on with its chord's slope where its own is steeper.
        """
        heights = self.noise(p).heights
        assert heights is not None
        mean = float(np.mean([heights(u).mean() for u in self._standardised(p)]))
        noise = self.noise(p, mean)
        assert noise.heights is not None
        values = np.array(noise.heights.values)
        chord = (values[-1] - values[0]) / (KNOTS[-1] - KNOTS[0])
        slopes = np.minimum(np.diff(values)[[0, -1]] / np.diff(KNOTS)[[0, -1]], chord)
        reach = BEYOND - KNOTS[-1]
        ends = values[0] - slopes[0] * reach, values[-1] + slopes[1] * reach
        return replace(
            noise,
            heights=HeightMap(
                knots=(-BEYOND, *noise.heights.knots, BEYOND),
                values=(float(ends[0]), *noise.heights.values, float(ends[1])),
            ),
        )


@lru_cache(maxsize=32)
def calibrate(wanted: NoiseTarget, *, octaves: int = 4) -> Solution:
    """Solve the noise for what is wanted of the scan; the same inputs are solved once a process."""
    bench = _Bench(wanted, octaves, FINE_POINTS)
    coarse = _Bench(wanted, octaves, COARSE_POINTS)
    best: Floats | None = None
    lowest = math.inf
    for persistence in (0.5, 0.15):
        p = _first_guess(wanted, persistence)
        # a recording's own heights are aimed at, figures alone leave them open
        for straightness in STRAIGHTNESS if wanted.quantiles_mm is None else (0.0,):
            p = _iterate(coarse, p, straightness, rounds=20)
            p = _iterate(bench, p, straightness, rounds=10)
            worst = bench.worst_error(p)
            if worst < lowest:
                best, lowest = p, worst
            if lowest < GOOD_ENOUGH:
                break
        if lowest < GOOD_ENOUGH or wanted.quantiles_mm is not None:
            break
    assert best is not None
    figures, _ = bench.figures(best)
    return Solution(
        field=bench.finished(best),
        reached=Roughness(**{n: float(v) for n, v in zip(FIGURES, figures, strict=True)}),
        worst_error=lowest,
    )


def _first_guess(wanted: NoiseTarget, persistence: float) -> Floats:
    figures = wanted.figures()
    rq_mm = figures.get("rq_mm")
    if rq_mm is None:
        high = [figures[n] for n in ("rpm_mm", "rvm_mm", "rp_mm", "rv_mm") if n in figures]
        rq_mm = float(np.mean(high)) / 2.4 if high else figures.get("ra_mm", 0.01) / 0.8
    peaks = figures.get("pc_per_mm", 0.25 / wanted.pitch_x_mm)
    cell_x = float(np.clip(0.8 / peaks, 1.5 * wanted.pitch_x_mm, 40.0 * wanted.pitch_x_mm))
    cell_y = max(cell_x, 1.5 * wanted.pitch_y_mm)
    logit = math.log(persistence / (1.0 - persistence))
    slopes = np.full(SLOPES, math.log(rq_mm))
    return np.concatenate((slopes, [math.log(cell_x), math.log(cell_y), logit]))


def _iterate(bench: _Bench, p: Floats, straightness: float, rounds: int) -> Floats:
    """Damped Gauss-Newton on the residuals and on what holds the rest of the parameters.

    That is the map's distance from a straight line in the mean square of a Gaussian, weighted by
    `straightness`, and its bends (second differences of the logarithms of its slopes).
    """
    moving = [*range(SLOPES + 1), *([SLOPES + 1] if bench.both else []), SLOPES + 2]
    bends = np.zeros((SLOPES, p.size))
    bends[: SLOPES - 2, :SLOPES] = BEND * np.diff(np.eye(SLOPES), n=2, axis=0)
    bends[-2, SLOPES + 1], bends[-1, SLOPES + 2] = 1e-4, 1e-3
    share = np.exp(-0.5 * KNOTS**2) * np.gradient(KNOTS)
    share /= share.sum()

    def crooked(q: Floats) -> Floats:
        heights = np.concatenate(([0.0], np.cumsum(np.exp(q[:SLOPES]) * np.diff(KNOTS))))
        heights -= share @ heights
        slope = (share @ (heights * KNOTS)) / (share @ KNOTS**2)
        return np.asarray(straightness * np.sqrt(share) * (heights / slope - KNOTS))

    low = np.full(p.size, -np.inf)
    low[SLOPES] = math.log(GRID_LIMIT * bench.wanted.pitch_x_mm)
    low[SLOPES + 1] = math.log(GRID_LIMIT * bench.wanted.pitch_y_mm)
    low[SLOPES + 2] = -4.0
    high = np.full(p.size, np.inf)
    high[SLOPES] = math.log(0.5 * bench.wanted.points * bench.wanted.pitch_x_mm)
    high[SLOPES + 1] = math.log(0.5 * max(bench.wanted.profiles, 3) * bench.wanted.pitch_y_mm)
    high[SLOPES + 2] = 4.0
    p = np.clip(p, low, high)

    def cost_of(q: Floats) -> tuple[Floats, float]:
        r = np.concatenate((bench.residuals(q), crooked(q), bends @ q))
        return r, float(r @ r)

    r, cost = cost_of(p)
    damping = 1e-3
    for _ in range(rounds):
        jacobian = _jacobian(lambda q: cost_of(q)[0], p, r, moving, high)
        normal = jacobian.T @ jacobian
        gradient = jacobian.T @ r
        scale = np.maximum(np.diag(normal), 1e-3 * float(np.diag(normal).max()))
        gained = 0.0
        for _ in range(5):
            step = -np.linalg.solve(normal + damping * np.diag(scale), gradient)
            step *= min(1.0, 1.0 / float(np.abs(step).max()))
            trial = p.copy()
            trial[moving] += step
            trial = np.clip(trial, low, high)
            r_trial, cost_trial = cost_of(trial)
            if cost_trial < cost:
                gained = cost - cost_trial
                p, r, cost = trial, r_trial, cost_trial
                damping = max(damping / 4.0, 1e-9)
                break
            damping *= 5.0
        if gained < 0.01 * cost:
            break
    return p


def _jacobian(
    residuals: Callable[[Floats], Floats], p: Floats, r: Floats, moving: list[int], high: Floats
) -> Floats:
    columns = []
    for k in moving:
        step = 0.05 if p[k] + 0.05 <= high[k] else -0.05
        moved = p.copy()
        moved[k] += step
        columns.append((residuals(moved) - r) / step)
    return np.stack(columns, axis=1)
