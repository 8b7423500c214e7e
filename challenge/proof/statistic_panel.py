"""What an answer is about where it moves no reading: noise, outliers or missing readings."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from challenge.proof.panel import Panel, name_axes, robust_sd
from challenge.proof.story import Scanned, Story

Field = NDArray[np.float64]
BINS, BLOCK = 24, 7
"""Bins of a curve, points a side of a map's blocks: a picture's choice."""
OUTLIER_SIGMA = 4.0
"""Robust deviations beyond which a reading is drawn as an outlier: a picture's choice."""
CHANNELS = {
    "mean": "mean residual, µm",
    "scale": "noise of a reading, µm",
    "outliers": f"readings beyond {OUTLIER_SIGMA:.0f} standard deviations, %",
    "missing": "missing readings, %",
}
_NOISE = np.sqrt(np.pi / 2)  # the mean of |x| of a normal variable is sd sqrt(2/π)


def _column(scanned: Scanned) -> Field:
    return np.broadcast_to(np.arange(scanned.depth_mm.shape[1]), scanned.depth_mm.shape)


def _profile(scanned: Scanned) -> Field:
    return np.broadcast_to(np.arange(scanned.depth_mm.shape[0])[:, None], scanned.depth_mm.shape)


COVARIATES: dict[str, tuple[str, Callable[[Scanned], Field]]] = {
    "column of the profile": ("point of the profile", _column),
    "position along the laser line": ("point of the profile", _column),
    "angle between laser and surface normal": (
        "angle between laser and surface normal, °", lambda scanned: scanned.angle_deg,
    ),
    "time since the first profile": ("profile", _profile),
    "position along the travel": ("profile", _profile),
}  # fmt: skip
"""Covariate of an answer -> label of the axis, values; others are drawn as a map."""


def subject(answer: dict[str, Any]) -> tuple[str, str]:
    """Return channel and covariate of what an answer found, unnamed structure where that is all.

    An effect that moves no reading acts on missing readings where it improves their Brier score,
    on the noise otherwise.
    """
    if answer["effects"]:
        heldout = answer.get("heldout", {})
        before, after = (
            float(heldout.get(key, {}).get("missing_brier", 0.0)) for key in ("before", "after")
        )
        channel = "missing" if after < before else "scale"
        return channel, str(answer["effects"][0].get("covariate", ""))
    left = max(answer.get("left", ()), key=lambda one: float(one["probability"]), default=None)
    return ("scale", "") if left is None else (str(left["channel"]), str(left["covariate"]))


def statistic_panel(story: Story) -> Panel:
    """Draw the statistic against its covariate over all recordings, or as a map of blocks."""
    channel, covariate = subject(story.answer)
    title = f"found: {CHANNELS[channel]}"
    if covariate not in COVARIATES:
        return Panel(title=title, draw=lambda axis: _map(axis, story.held, channel))
    label, values = COVARIATES[covariate]
    return Panel(
        title=title, draw=lambda axis: _curve(axis, story.scans, channel, values, label)
    )  # fmt: skip


def statistic(scanned: Scanned, channel: str) -> Field:
    """Return the statistic of each reading, NaN where there is none.

    Its mean over readings is what `CHANNELS` names.
    """
    rest = 1e3 * (scanned.depth_mm - scanned.simulated_mm)
    if channel == "missing":
        return np.where(np.isfinite(scanned.simulated_mm), 100.0 * scanned.lost, np.nan)
    far = np.abs(rest - np.nanmedian(rest)) > OUTLIER_SIGMA * robust_sd(rest)
    if channel == "outliers":
        return np.where(np.isfinite(rest), 100.0 * far, np.nan)
    near = np.where(far, np.nan, rest)
    return near if channel == "mean" else np.abs(near) * _NOISE


def _curve(
    axis: Any, scans: tuple[Scanned, ...], channel: str, values: Callable[[Scanned], Field],
    label: str,
) -> None:  # fmt: skip
    x = np.concatenate([np.asarray(values(s), np.float64).ravel() for s in scans])
    y = np.concatenate([statistic(s, channel).ravel() for s in scans])
    known = np.isfinite(x) & np.isfinite(y)
    x, y = x[known], y[known]
    edges = np.unique(np.quantile(x, np.linspace(0, 1, BINS + 1)))
    which = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, max(edges.size - 2, 0))
    count = np.maximum(np.bincount(which), 1)
    mean = np.bincount(which, weights=y) / count
    error = 2 * np.sqrt(np.maximum(np.bincount(which, weights=y * y) / count - mean**2, 0) / count)
    at = np.bincount(which, weights=x) / count
    axis.errorbar(at, mean, yerr=error, fmt="o", ms=3, lw=1, color="tab:blue",
                  label="recordings, with 95 % interval")  # fmt: skip
    axis.axhline(float(y.mean()), color="0.5", lw=1, ls="--", label="mean of all readings")
    low, high = float((mean - error).min()), float((mean + error).max())
    room = (high - low) or 1.0
    axis.set_ylim(low - 0.1 * room if channel == "scale" else min(low, 0.0), high + 0.35 * room)
    axis.set_xlabel(label, fontsize=8)
    axis.legend(fontsize=7, frameon=False, loc="upper right")


def _map(axis: Any, scanned: Scanned, channel: str) -> None:
    field = statistic(scanned, channel)
    rows, columns = (size // BLOCK * BLOCK for size in field.shape)
    blocks = field[:rows, :columns].reshape(rows // BLOCK, BLOCK, columns // BLOCK, BLOCK)
    count = np.isfinite(blocks).sum((1, 3))
    mean = np.where(count > 0, np.nansum(blocks, (1, 3)) / np.maximum(count, 1), np.nan)
    low, high = np.nanpercentile(mean, (2, 98)) if np.isfinite(mean).any() else (0.0, 1.0)
    drawn = axis.imshow(mean, aspect="auto", interpolation="nearest", extent=(0, columns, rows, 0),
                        cmap="magma", vmin=low, vmax=high)  # fmt: skip
    axis.figure.colorbar(drawn, ax=axis, shrink=0.85).ax.tick_params(labelsize=7)
    name_axes(axis)
