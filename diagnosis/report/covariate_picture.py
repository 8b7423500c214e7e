"""Readings against the covariate of a found effect, with the fitted curve."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from diagnosis.diagnosis import Diagnosis
from diagnosis.fields import Field, Mask
from diagnosis.model.workspace import Workspace
from diagnosis.report.canvas import (
    BEFORE,
    INK,
    PALE,
    binned,
    binned_medians,
    figure_of,
    png,
)
from diagnosis.validate.found_effects import FoundEffect
from files.errors import RecipeError
from sensors.view.covariates import COVARIATES

FEWEST = 50
"""Readings below which means over bins show nothing."""
HALF_NORMAL_MEDIAN = 0.6745
"""Median of the size of a standard normal variable."""
HALF_NORMAL_MEDIAN_ERROR = 1.1664
"""Standard error of that median from one reading, relative: 1 / (2 f(m) m), f(m) = 0.6356."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Samples:
    """Readings of all fitted recordings in a row, with and without one effect.

    Attributes
    ----------
    covariate : (k,)
    residual_mm : (k,) against the model without the effect, at its placement
    change_mm : (k,) of the mean by the effect, less what a placement takes up
    sd_mm : (k,) with the effect
    at, missing, p_missing : (l,) covariate where a reading is expected, whether it is missing, and
        with what probability under the effect
    """

    covariate: Field
    residual_mm: Field
    change_mm: Field
    sd_mm: Field
    at: Field
    missing: Field
    p_missing: Field


def covariate_picture(result: Diagnosis, found: FoundEffect) -> bytes | None:
    """Draw readings against an effect's covariate, and the fit; None where neither shows."""
    samples = samples_of(result, found)
    if samples is None:
        return None
    figure, (axis,) = figure_of(5.2, 3.3)
    for channel, draw in (("mean", _draw_mean), ("missing", _draw_missing), ("", _draw_scale)):
        if not channel or channel in found.effect.channels:
            if not draw(axis, samples, f"fitted: {found.name.replace('_', ' ')}"):
                return None
            break
    covariate = COVARIATES[found.covariate_key]
    unit = f", {covariate.unit}" if covariate.unit else ""
    axis.set_xlabel(f"{covariate.words}{unit}", fontsize=8)
    axis.legend(fontsize=7, frameon=False)
    return png(figure)


def samples_of(result: Diagnosis, found: FoundEffect) -> Samples | None:
    """Collect the readings; None where the sensor's file doesn't state what the covariate needs."""
    ws = Workspace.build(result.fit_patches, result.noise)
    predictions = ws.predict(result.model.without(found.name))
    states = ws.states(predictions)
    final = ws.predict(result.model)
    own = found.effect.covariate == found.covariate_key
    values_of = found.effect.covariate_values if own else COVARIATES[found.covariate_key].values
    try:
        values_of(ws.patches[0].view)
    except RecipeError:
        return None  # a camera that the sensor's file doesn't state
    read, expected = [], []
    for patch, before, after, state in zip(ws.patches, predictions, final, states, strict=True):
        c = np.broadcast_to(values_of(patch.view), patch.shape)
        use = state.used & np.isfinite(c) & patch.fit
        moved = _pose_part(patch.columns, state.residual_mm, state.used)
        change = np.nan_to_num(after.mean_mm - before.mean_mm)
        pose_change = _pose_part(patch.columns, change, state.used & after.seen)
        columns = (
            c, state.residual_mm - moved, change - pose_change, after.sd_mm * result.model.level,
        )  # fmt: skip
        read.append(np.stack([column[use] for column in columns]))
        seen = before.seen & np.isfinite(c) & patch.fit
        missing = (~patch.observed).astype(float)
        expected.append(np.stack([column[seen] for column in (c, missing, after.p_missing)]))
    covariate, residual, change, sd = np.concatenate(read, axis=1)
    at, lost, p_missing = np.concatenate(expected, axis=1)
    return Samples(
        covariate=covariate, residual_mm=residual, change_mm=change, sd_mm=sd, at=at, missing=lost,
        p_missing=p_missing,
    )  # fmt: skip


def _draw_mean(axis: Any, samples: Samples, label: str) -> bool:
    """Draw residuals and the change of the mean; False where the covariate shows nothing."""
    x, y, fit = samples.covariate, 1e3 * samples.residual_mm, 1e3 * samples.change_mm
    if _bare(x):
        return False
    pick = np.random.default_rng(0).permutation(x.size)[:3000]
    axis.plot(x[pick], y[pick], ".", ms=1, color=PALE, rasterized=True)
    mean, model = _draw_bins(axis, x, y, fit, (label, "recordings, mean of a bin"))
    reach = max(np.nanmax(np.abs(mean)), np.nanmax(np.abs(model)), np.quantile(np.abs(y), 0.8))
    axis.set_ylim(-2.2 * reach, 2.2 * reach)
    axis.set_ylabel("residual, µm", fontsize=8)
    return True


def _draw_scale(axis: Any, samples: Samples, label: str) -> bool:
    """Draw the size of the noise; False where the covariate shows nothing."""
    if _bare(samples.covariate):
        return False
    # medians: a few readings at edges have a hundred times the noise of the others
    centre, size, count = binned_medians(samples.covariate, 1e3 * np.abs(samples.residual_mm))
    size = size / HALF_NORMAL_MEDIAN
    error = 2 * HALF_NORMAL_MEDIAN_ERROR * size / np.sqrt(count)
    _, model, _ = binned_medians(samples.covariate, 1e3 * samples.sd_mm)
    axis.errorbar(centre, size, yerr=error, fmt="o", ms=3, color=INK, lw=1, label="recordings")
    axis.plot(centre, model, "-", color=BEFORE, lw=2, label=label)
    low, high = float(min((size - error).min(), model.min())), float((size + error).max())
    room = 0.3 * max(high - low, 0.05 * high)
    axis.set_ylim(max(low - room, 0.0), max(high, float(model.max())) + room)
    axis.set_ylabel("noise of a reading, µm", fontsize=8)
    return True


def _draw_missing(axis: Any, samples: Samples, label: str) -> bool:
    """Draw the share of missing readings; False where the covariate shows nothing."""
    if np.ptp(samples.at) == 0:
        return False
    centre, mean, low, high = binned(samples.at, samples.missing)
    _, model, _, _ = binned(samples.at, samples.p_missing)
    error = 100 * np.stack([mean - np.maximum(low, 0.0), high - mean])
    axis.errorbar(centre, 100 * mean, yerr=error, fmt="o", ms=3, color=INK, lw=1,
                  label="recordings")  # fmt: skip
    axis.plot(centre, 100 * model, "-", color=BEFORE, lw=2, label=label)
    axis.set_ylim(0.0, 130 * max(float(high.max()), float(model.max()), 1e-3))
    axis.set_ylabel("missing readings, %", fontsize=8)
    return True


def _bare(x: Field) -> bool:
    return bool(x.size < FEWEST or np.ptp(x) == 0)


def _draw_bins(
    axis: Any, x: Field, y: Field, fit: Field, labels: tuple[str, str]
) -> tuple[Field, Field]:
    """Draw means over bins and the fitted curve, µm, and return both."""
    centre, mean, low, high = binned(x, y)
    _, model, _, _ = binned(x, fit)
    axis.errorbar(centre, mean, yerr=[mean - low, high - mean], fmt="o", ms=3, color=INK, lw=1,
                  label=labels[1])  # fmt: skip
    axis.plot(centre, model, "-", color=BEFORE, lw=2, label=labels[0])
    return mean, model


def _pose_part(columns: Field, field: Field, used: Mask) -> Field:
    """Fit the part of a field that a placement takes up."""
    flat, values = columns[used], field[used]
    step = max(1, len(values) // 20000)
    solved, *_ = np.linalg.lstsq(flat[::step], values[::step], rcond=1e-6)
    return np.asarray(columns @ solved)
