"""The held-out profile that the effects improve most, and all held-out residuals."""

from typing import Any

import numpy as np

from diagnosis.diagnosis import Diagnosis
from diagnosis.fields import Field
from diagnosis.report.canvas import AFTER, BEFORE, PALE, figure_of, png
from diagnosis.validate.heldout import Judgement

WORDS = ("nominal model", "with the effects found")
Shown = tuple[tuple[Judgement, str, str], ...]


def shown_of(result: Diagnosis) -> Shown:
    """Return judgements with colour and words; the nominal model's alone where both are equal."""
    both = ((result.before, BEFORE, WORDS[0]), (result.after, AFTER, WORDS[1]))
    same = all(
        np.array_equal(before, after, equal_nan=True)
        for before, after in zip(
            result.before.residuals_mm, result.after.residuals_mm, strict=True
        )
    )
    return ((result.before, AFTER, WORDS[0]),) if same else both


def profile_picture(result: Diagnosis) -> bytes | None:
    """Draw a held-out profile before and after, and both distributions of the residual."""
    shown = shown_of(result)
    left_mm = [
        np.concatenate([r[np.isfinite(r)] for r in judged.residuals_mm])
        for judged, _, _ in shown
    ]
    every = np.abs(np.concatenate(left_mm))
    if not every.size:
        return None
    # a few readings from elsewhere, at a step's foot, are no scale for the others
    reach = max(10 * result.noise.sd_mm, 1.4 * float(np.quantile(every, 0.98)))
    best = most_improved(result, reach)
    if best is None:
        return None
    figure, (left, right) = figure_of(10.5, 3.0, 2)
    _draw_profile(left, result, shown, best, reach)
    for values, (_, colour, words) in zip(left_mm, shown, strict=True):
        limit = max(4e3 * result.noise.sd_mm, float(np.quantile(np.abs(1e3 * values), 0.98)))
        right.hist(1e3 * values, bins=90, range=(-limit, limit), histtype="step", color=colour,
                   label=words)  # fmt: skip
    right.set_xlabel("reading - expectation, µm", fontsize=8)
    right.set_yticks([])
    right.set_ylabel("readings", fontsize=8)
    right.set_title("all held-out readings", fontsize=9)
    right.legend(fontsize=7, frameon=False)
    return png(figure)


def most_improved(result: Diagnosis, reach_mm: float) -> tuple[int, int] | None:
    """Return patch and row of the profile whose squares shrink most; None without readings.

    Parameters
    ----------
    reach_mm : residuals beyond it count as it
    """
    best, largest = None, -np.inf
    for k, (before, after) in enumerate(
        zip(result.before.residuals_mm, result.after.residuals_mm, strict=True)
    ):
        saved = _clipped(before, reach_mm) ** 2 - _clipped(after, reach_mm) ** 2
        gain = np.nansum(saved, axis=1)
        full = np.isfinite(before).sum(axis=1)
        if full.max() == 0:
            continue
        gain[full < 0.5 * full.max()] = -np.inf
        row = int(np.argmax(gain))
        if best is None or gain[row] > largest:
            best, largest = (k, row), float(gain[row])
    return best


def _clipped(residual_mm: Field, reach_mm: float) -> Field:
    return np.clip(residual_mm, -reach_mm, reach_mm)


def _draw_profile(
    axis: Any, result: Diagnosis, shown: Shown, at: tuple[int, int], reach_mm: float
) -> None:
    patch, row = result.held_patches[at[0]], at[1]
    for judged, colour, words in shown:
        near = 1e3 * _clipped(judged.residuals_mm[at[0]][row], reach_mm)
        axis.plot(patch.view.column_x_mm, near, ".", ms=2.5, color=colour, label=words)
    axis.set_ylim(-1.05e3 * reach_mm, 1.05e3 * reach_mm)
    axis.axhline(0, color=PALE, lw=0.8, zorder=0)
    axis.set_xlabel("x, mm", fontsize=8)
    axis.set_ylabel("reading - expectation, µm", fontsize=8)
    title = f"held out: {patch.name}\nprofile {patch.rows.start + row}"
    axis.set_title(title, fontsize=9, parse_math=False)
    axis.legend(fontsize=7, frameon=False)
