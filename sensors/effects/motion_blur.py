"""The sensor moves during the exposure: a box average along the travel and a shift."""

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from sensors.effects.base import Effect
from sensors.effects.parameter import parameter
from sensors.law import Law, sheet_effects
from sensors.line_operator import between_rows, read_line
from sensors.view import View

SHARES = (0.25, 0.9, 2.0, 4.0)
EXPOSURES = 8
"""Poses at which the way during an exposure is sampled, midpoints of equal parts."""


@dataclass(frozen=True, kw_only=True, slots=True)
class MotionBlur(Effect):
    """Mean over the way travelled during the exposure, which starts at the commanded pose."""

    name: ClassVar = "motion_blur"
    summary: ClassVar = (
        "The sensor travels during the exposure: edges are blurred along the travel and "
        "everything lags by half the way."
    )
    equation: ClassVar = "z_m = mean of z(y + v t), t from 0 to the exposure time"
    source: ClassVar = (
        "Box average over the exposure; shift v·t_exp/2, bias (v·t_exp)²/24 · ∂²z/∂y² beyond it"
    )
    statement: ClassVar = (
        "The sensor moves on during an exposure of {exposure_ms:.2f} ms: edges are blurred along "
        "the travel and shifted by half the way."
    )
    channels: ClassVar = ("mean",)
    frame: ClassVar = "travel"
    covariate: ClassVar = "curvature_y"
    rivals: ClassVar = ("finite_spot", "travel_ripple", "pose_error")
    separating: ClassVar = (
        "vary the speed: blur and shift grow with it; reverse the travel: the shift changes sides"
    )

    exposure_ms: float | None = parameter(
        "time during which the line is exposed",
        unit="ms",
        low=0.0,
        high=10000.0,
        typical=0.5,
        null=0.0,
        sheet="exposure_s",
    )

    def grid(self, view: View) -> tuple[Self, ...]:
        """Return exposures that last a quarter of the time between profiles to four times that."""
        step_s = float(np.median(np.diff(view.time_s))) if len(view.time_s) > 1 else 0.0
        longest = self.parameter("exposure_ms").high
        times = [min(1e3 * share * step_s, longest) for share in SHARES if step_s > 0]
        return tuple(self.with_parameters(exposure_ms=t) for t in times)

    def changed(self, law: Law, view: View) -> Law:
        """Add the difference between the exposure's mean and its start."""
        exposure_ms = self.exposure_ms
        if exposure_ms is None:
            exposure_ms = 1e3 * view.datasheet.require("exposure_s")
        if len(view.poses) < 2:
            return law
        step_s = np.diff(view.time_s)
        step_s = np.concatenate([step_s, step_s[-1:]])
        steps = np.divide(
            exposure_ms * 1e-3, step_s, out=np.zeros_like(step_s), where=step_s > 0
        )
        way = view.travel_step_mm * steps
        if np.ptp(way) <= 1e-9 * np.max(np.abs(way)):
            way = way[:1]
        share = (np.arange(EXPOSURES) + 0.5)[:, None] / EXPOSURES
        seen = view.datasheet.triangulation_angle_deg is not None
        line = read_line(
            view, share * way, [1.0] * EXPOSURES, visible=seen, merge_mm=_merging_mm(view)
        )
        change = np.where(np.isfinite(line.depth_mm), line.depth_mm - view.depth_mm, 0.0)
        # what the line's width does at one place is averaged on the way, too
        spot = np.nan_to_num(law.mean_mm - view.depth_mm)
        if np.any(spot):
            rows = np.arange(len(spot)) + share * steps
            change += np.mean([between_rows(spot, r) for r in rows], axis=0) - spot
        return replace(law, mean_mm=law.mean_mm + change)


def _merging_mm(view: View) -> float:
    """How far two levels that were lit one after the other may lie apart to be read as one."""
    listed = (e for e in sheet_effects(view) if e.name == "edge_mixing")
    return 1e-3 * max((float(getattr(e, "merge_um", 0.0)) for e in listed), default=0.0)
