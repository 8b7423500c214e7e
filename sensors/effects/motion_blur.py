"""The sensor moves during the exposure: a box average along the travel and a shift."""

import math
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from sensors.effects.base import Effect
from sensors.effects.parameter import parameter
from sensors.law import Law, sheet_effects
from sensors.line_operator import STEEPEST, between_rows, read_line
from sensors.view import Reason, View

Floats = NDArray[np.float64]

SHARES = (0.25, 0.9, 2.0, 4.0)
FEWEST_STEPS = 8
"""Steps that the way during an exposure is divided into: so many at least, twice that at most."""


@dataclass(frozen=True, kw_only=True, slots=True)
class MotionBlur(Effect):
    """Mean over the way travelled during the exposure.

    The light of every instant counts as much as it is bright, and speckle makes it flicker: where
    the depth changes on the way, the reading scatters for it.
    """

    name: ClassVar = "motion_blur"
    summary: ClassVar = (
        "The sensor travels during the exposure: edges are blurred along the travel and "
        "everything lags by half the way."
    )
    equation: ClassVar = (
        "z_m = mean of z(y + v t), t from 0 to t_exp; σ² = σ0² + f² var of z(y + v t)"
    )
    source: ClassVar = (
        "Box average over the exposure; shift v·t_exp/2, bias (v·t_exp)²/24 · ∂²z/∂y² beyond it; "
        "variance of a mean of N depths with random weights of relative scatter f √N; "
        "f v·t_exp ∂z/∂y / √12 on a slope"
    )
    statement: ClassVar = (
        "The sensor moves on during an exposure of {exposure_ms:.2f} ms: edges are blurred along "
        "the travel{shifted}."
    )
    channels: ClassVar = ("mean", "variance")
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
    flicker: float = parameter(
        "relative scatter f of the brightness over a whole exposure",
        low=0.0,
        high=1.0,
        typical=0.2,
    )
    stamped: str = parameter(
        "where in the exposure the stated pose is",
        typical="start",
        choices=("start", "middle"),
    )

    def grid(self, view: View) -> tuple[Self, ...]:
        """Return exposures that last a quarter of the time between profiles to four times that.

        Where a recording was registered its poses are those of the exposures' middle.
        """
        step_s = float(np.median(np.diff(view.time_s))) if len(view.time_s) > 1 else 0.0
        longest = self.parameter("exposure_ms").high
        times = [min(1e3 * share * step_s, longest) for share in SHARES if step_s > 0]
        return tuple(self.with_parameters(exposure_ms=t, stamped="middle") for t in times)

    def words(self) -> dict[str, str]:
        """Say what becomes of the place."""
        return {"shifted": " and shifted by half the way" if self.stamped == "start" else ""}

    def changed(self, law: Law, view: View) -> Law:
        """Add the difference between the exposure's mean and the stated pose, and the scatter."""
        if len(view.poses) < 2:
            return law
        steps = self.steps(view)
        if not np.any(steps * view.travel_step_mm):
            return law
        ahead, shares = self.nodes(steps)
        travel = view.travel_step_mm
        if np.ptp(travel) <= 1e-9 * np.max(np.abs(travel)):
            travel = travel[:1]
        seen = view.datasheet.triangulation_angle_deg is not None
        line = read_line(
            view, ahead[:, None] * travel, list(shares[:, :, None]), visible=seen,
            merge_mm=_merging_mm(view),
        )  # fmt: skip
        lit = np.isfinite(line.depth_mm)
        mean = line.depth_mm + self._widened(law, view, ahead, shares, line.depth_mm)
        # the nodes spread more than the way
        square = 12 * (ahead**2 @ shares - (ahead @ shares) ** 2)
        narrower = np.divide(steps, np.sqrt(square), out=np.ones_like(steps), where=square > 0)
        spread = np.nan_to_num(line.spread_mm) * narrower[:, None]
        # what the camera sees during a part of the exposure it reads
        hidden = law.reason == Reason.HIDDEN_FROM_CAMERA
        return replace(
            law,
            mean_mm=np.where(lit & (np.isfinite(law.mean_mm) | hidden), mean, law.mean_mm),
            reason=np.where(lit & hidden, np.uint8(Reason.VALID), law.reason),
            white_sd_mm=np.hypot(law.white_sd_mm, self.flicker * spread),
        )

    def nodes(self, steps: Floats) -> tuple[Floats, Floats]:
        """Divide the way by nodes whose distance is a power of two, the same for like exposures.

        So a search over the exposure meets the same displaced views again. A node's share is the
        integral over the way of its hat function: exact on slopes, continuous in the exposure.

        Parameters
        ----------
        steps : (n,) way during each profile's exposure, in profiles

        Returns
        -------
        ahead : (k,) nodes, in profiles ahead of the stated pose
        shares : (k, n) share of each profile's light that each node stands for
        """
        start = -0.5 * steps if self.stamped == "middle" else np.zeros_like(steps)
        end = start + steps
        apart = 2.0 ** math.floor(math.log2(float(steps.max()) / FEWEST_STEPS))
        first, last = math.floor(float(start.min()) / apart), math.ceil(float(end.max()) / apart)
        ahead = apart * np.arange(first, last + 1)

        def under_hat(way: Floats) -> Floats:
            """Integral of each node's hat function up to a way."""
            u = np.clip((way - ahead[:, None]) / apart, -1.0, 1.0)
            return np.asarray(apart * (0.5 + u - 0.5 * u * np.abs(u)))

        inside = under_hat(end) - under_hat(start)
        still = steps <= 0
        shares = np.where(still, 1.0 / len(ahead), inside / np.where(still, 1.0, steps))
        return np.asarray(ahead), np.asarray(shares)

    @staticmethod
    def _widened(law: Law, view: View, ahead: Floats, shares: Floats, read_mm: Floats) -> Floats:
        """Average on the way what other effects do at one place, on the level that is read."""
        spot = law.mean_mm - view.depth_mm
        if view.datasheet.triangulation_angle_deg is not None:
            spot = np.where(view.visible, spot, np.nan)  # else another level's light is read
        total, count = np.zeros(view.shape), np.zeros(view.shape)
        if np.any(np.nan_to_num(spot)):
            way = np.ptp(ahead) * float(np.abs(view.travel_step_mm).max())
            for step, share in zip(ahead, shares, strict=True):
                rows = np.arange(len(spot)) + step
                here, level = between_rows(spot, rows), between_rows(view.depth_mm, rows)
                own = np.isfinite(here) & (np.abs(level - read_mm) <= STEEPEST * way / 2)
                total += share[:, None] * np.where(own, here, 0.0)
                count += share[:, None] * own
        return total / np.where(count > 0, count, 1.0)

    def steps(self, view: View) -> Floats:
        """Return the way during each profile's exposure, (n,) in profiles."""
        exposure_ms = self.exposure_ms
        if exposure_ms is None:
            exposure_ms = 1e3 * view.datasheet.require("exposure_s")
        step_s = np.diff(view.time_s)
        step_s = np.concatenate([step_s, step_s[-1:]])
        return np.divide(
            exposure_ms * 1e-3, step_s, out=np.zeros_like(step_s), where=step_s > 0
        )


def _merging_mm(view: View) -> float:
    """How far two levels that were lit one after the other may lie apart to be read as one."""
    listed = (e for e in sheet_effects(view) if e.name == "edge_mixing")
    return 1e-3 * max((float(getattr(e, "merge_um", 0.0)) for e in listed), default=0.0)
