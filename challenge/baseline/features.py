"""Figures of a case's residuals, as a data scientist would list them."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from challenge.baseline.residuals import Residuals, of_case
from challenge.cases.truth import levelled

Floats = NDArray[np.float64]
_BEND_MM = 0.02  # second difference of the nominal depth that counts as an edge
_LEAST = 200  # readings off edges that a recording must have for figures of its own


def features(folder: Path) -> dict[str, float]:
    """Figures of a case: mean and spread over its recordings, and what these have in common."""
    found, good = of_case(folder)
    each = [_of_recording(r) for r in found]
    out: dict[str, float] = {}
    for name in dict.fromkeys(n for one in each for n in one):
        values = np.array([one[name] for one in each])
        out[name] = float(np.nanmean(values)) if np.isfinite(values).any() else np.nan
        if len(each) > 1:
            out[f"{name}, spread"] = float(np.nanstd(values))
    out["recordings"] = float(len(found))
    columns = [_by_column(r) for r in found]
    out["columns alike"] = _alike(columns)
    out["later is deeper"] = _drift(found)
    before = [_of_recording(r)["noise"] for r in good]
    out["noise against baselines"] = out["noise"] / float(np.mean(before)) if before else np.nan
    out["columns against baselines"] = np.nan
    if good:
        usual = np.nanmean([_by_column(r) for r in good], axis=0)
        rest = np.nanmean(columns, axis=0) - usual
        out["columns against baselines"] = float(np.nanstd(rest)) / out["noise"]
    return out


def _edges(nominal: Floats) -> NDArray[np.bool_]:
    sharp = ~np.isfinite(nominal)
    for axis in (0, 1):
        bend = np.abs(np.diff(np.nan_to_num(nominal, nan=1e3), 2, axis=axis)) > _BEND_MM
        sharp |= np.pad(bend, [(1, 1) if a == axis else (0, 0) for a in (0, 1)])
    return np.asarray(binary_dilation(sharp, np.ones((5, 5), bool)))


def _level(r: Residuals) -> tuple[Floats, NDArray[np.bool_]]:
    smooth = ~_edges(r.nominal_mm)
    return levelled(r.rest_mm, smooth & np.isfinite(r.rest_mm), r.nominal_mm), smooth


def _by_column(r: Residuals) -> Floats:
    rest, smooth = _level(r)
    with np.errstate(invalid="ignore"):
        kept = np.where(smooth, rest, np.nan)
    count = np.isfinite(kept).sum(0)
    return np.where(count > 5, np.nansum(kept, 0) / np.maximum(count, 1), np.nan)


def _of_recording(r: Residuals) -> dict[str, float]:
    rest, smooth = _level(r)
    kept = np.where(smooth & np.isfinite(rest), rest, np.nan)
    seen = np.isfinite(kept)
    noise = 1.4826 * float(np.nanmedian(np.abs(np.diff(kept, axis=1)))) / np.sqrt(2)
    if seen.sum() < _LEAST or not noise > 0:
        return {"noise": np.nan}
    scaled = kept / noise
    slope_y, slope_x = (np.asarray(slope) for slope in np.gradient(r.nominal_mm))
    curve = np.gradient(slope_y, axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        print_y = np.gradient(np.log(np.maximum(r.brightness, 1e-4)), axis=0)
    x = np.broadcast_to(r.x_mm / np.abs(r.x_mm).max(), kept.shape)
    z = r.from_middle_mm
    out = {
        "noise": noise,
        "size": float(np.nanstd(scaled)),
        "tails": float(np.nanmean(np.clip(scaled, -30, 30) ** 4) / np.nanvar(scaled) ** 2),
        "outliers": float((np.abs(scaled[seen]) > 6).mean()),
        "lost off edges": float(np.isnan(r.depth_mm)[smooth].mean()),
        "lost at edges": float(np.isnan(r.depth_mm)[~smooth].mean()) if (~smooth).any() else 0.0,
        "at edges": _spread(rest[~smooth], noise),
        "alike along the line": _lagged(scaled, 1),
        "alike along the travel": _lagged(scaled, 0),
        "same as before": float((np.diff(r.depth_mm, axis=0) == 0)[seen[1:] & seen[:-1]].mean()),
        "brightness": float(np.nanmedian(r.brightness)),
        "lost where steep": _lost_where_steep(r, smooth, slope_y, slope_x),
        "noise where steep": _noise_where_steep(scaled, slope_y, slope_x),
    }
    covariates = {
        "x": x, "x²": x**2, "x³": x**3, "z": z, "z²": z**2, "x z": x * z, "slope y": slope_y,
        "|slope y|": np.abs(slope_y), "slope x": slope_x, "|slope x|": np.abs(slope_x),
        "curvature": curve, "print": print_y,
    }  # fmt: skip
    out |= {f"follows {name}": _follows(scaled, c, seen) for name, c in covariates.items()}
    rows = _means(scaled, 1)
    out["rows"] = float(np.nanstd(rows))
    out["rows, peak"], out["rows, at"] = _peak(rows)
    columns = _means(scaled, 0)
    out["columns"] = float(np.nanstd(columns))
    out["columns, jagged"] = float(np.nanstd(np.diff(columns)))
    slips = _slips(scaled, slope_y, seen)
    out["slips"] = float(np.nanstd(slips)) if np.isfinite(slips).any() else 0.0
    out["slips, peak"], out["slips, at"] = _peak(slips)
    return out


def _spread(values: Floats, noise: float) -> float:
    kept = values[np.isfinite(values)]
    return float(np.median(np.abs(kept)) / noise) if kept.size else 0.0


def _lagged(scaled: Floats, axis: int) -> float:
    a, b = (np.take(scaled, np.arange(k, scaled.shape[axis] - 1 + k), axis=axis) for k in (0, 1))
    both = np.isfinite(a) & np.isfinite(b)
    return float(np.mean(a[both] * b[both]) / np.nanvar(scaled)) if both.any() else 0.0


def _lost_where_steep(
    r: Residuals, smooth: NDArray[np.bool_], slope_y: Floats, slope_x: Floats
) -> float:
    steep = np.hypot(slope_y, slope_x)
    lost = np.isnan(r.depth_mm) & smooth & np.isfinite(steep)
    there = ~np.isnan(r.depth_mm) & smooth & np.isfinite(steep)
    if not lost.any() or not there.any():
        return 0.0
    return float(np.mean(steep[lost]) - np.mean(steep[there]))


def _noise_where_steep(scaled: Floats, slope_y: Floats, slope_x: Floats) -> float:
    steep = np.hypot(slope_y, slope_x)[:, 1:]
    step = np.abs(np.diff(scaled, axis=1))
    both = np.isfinite(step) & np.isfinite(steep)
    return _correlation(step[both], steep[both])


def _follows(scaled: Floats, covariate: Floats, seen: NDArray[np.bool_]) -> float:
    both = seen & np.isfinite(covariate)
    return _correlation(np.clip(scaled[both], -10, 10), covariate[both])


def _correlation(a: Floats, b: Floats) -> float:
    if a.size < 20 or np.ptp(a) == 0 or np.ptp(b) == 0:
        return 0.0
    return float(np.corrcoef(a, b)[0, 1])


def _means(scaled: Floats, axis: int) -> Floats:
    count = np.isfinite(scaled).sum(axis)
    return np.where(count > 5, np.nansum(scaled, axis) / np.maximum(count, 1), np.nan)


def _slips(scaled: Floats, slope_y: Floats, seen: NDArray[np.bool_]) -> Floats:
    """Regression of each profile's residual on its slopes along the travel."""
    use = seen & np.isfinite(slope_y)
    s = np.where(use, slope_y, 0.0)
    square = (s**2).sum(1)
    return np.where(square > 1e-3, (s * np.nan_to_num(scaled)).sum(1) / (square + 1e-9), np.nan)


def _peak(values: Floats) -> tuple[float, float]:
    """Largest line of a spectrum over its median, and where it is, cycles a profile."""
    kept = values[np.isfinite(values)]
    if kept.size < 16:
        return 0.0, 0.0
    power = np.abs(np.fft.rfft((kept - kept.mean()) * np.hanning(kept.size)))[2:]
    at = int(power.argmax())
    return float(power[at] / (np.median(power) + 1e-12)), (at + 2) / kept.size


def _alike(columns: list[Floats]) -> float:
    """Mean correlation of two recordings' column means."""
    found = []
    for i in range(len(columns)):
        for j in range(i):
            both = np.isfinite(columns[i]) & np.isfinite(columns[j])
            found.append(_correlation(columns[i][both], columns[j][both]))
    return float(np.mean(found)) if found else np.nan


def _drift(found: list[Residuals]) -> float:
    """Correlation of a profile's median residual with the instrument's clock."""
    if len(found) < 2:
        return np.nan
    rest = np.concatenate([np.nanmedian(r.rest_mm, axis=1) for r in found])
    clock = np.concatenate([r.clock_s for r in found])
    both = np.isfinite(rest)
    return _correlation(rest[both], clock[both])
