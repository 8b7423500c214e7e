"""The sensor moves during the exposure: a box average along the travel and a shift."""

import math
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from sensors.beam import merging_mm
from sensors.effects.base import Effect
from sensors.effects.parameter import parameter
from sensors.law import Law
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
        after_ms, shares = self.nodes(view)
        step_ms = 1e3 * np.diff(view.time_s, append=2 * view.time_s[-1] - view.time_s[-2])
        going = step_ms > 0
        ahead = np.where(going, after_ms[:, None] / np.where(going, step_ms, 1.0), 0.0)
        offsets = ahead * view.travel_step_mm
        reach = np.max(np.abs(offsets))
        if reach == 0:
            return law
        if np.max(np.ptp(offsets, axis=1)) <= 1e-9 * reach:
            offsets = offsets[:, :1]
        seen = view.datasheet.triangulation_angle_deg is not None
        line = read_line(
            view, offsets, list(shares), visible=seen, merge_mm=merging_mm(view)
        )
        lit = np.isfinite(line.depth_mm)
        mean = line.depth_mm + self._widened(law, view, ahead, shares, line.depth_mm, reach)
        # the nodes spread more than the exposure
        wider = math.sqrt(12 * (after_ms**2 @ shares - (after_ms @ shares) ** 2))
        spread = np.nan_to_num(line.spread_mm) * self.lasting_ms(view) / wider
        # what the camera sees during a part of the exposure it reads
        hidden = law.reason == Reason.HIDDEN_FROM_CAMERA
        return replace(
            law,
            mean_mm=np.where(lit & (np.isfinite(law.mean_mm) | hidden), mean, law.mean_mm),
            reason=np.where(lit & hidden, np.uint8(Reason.VALID), law.reason),
            white_sd_mm=np.hypot(law.white_sd_mm, self.flicker * spread),
        )

    def nodes(self, view: View) -> tuple[Floats, Floats]:
        """Divide the exposure by instants whose distance is a power of two.

        So a search over the exposure meets the same displaced views again. An instant's share is
        the integral over the exposure of its hat function: exact on slopes, continuous.

        Returns
        -------
        after_ms : (k,) instants, counted from that of the stated pose
        shares : (k,) share of the light that each stands for
        """
        lasting = self.lasting_ms(view)
        start = -0.5 * lasting if self.stamped == "middle" else 0.0
        end = start + lasting
        apart = 2.0 ** math.floor(math.log2(lasting / FEWEST_STEPS))
        after = apart * np.arange(math.floor(start / apart), math.ceil(end / apart) + 1)

        def under_hat(instant: float) -> Floats:
            """Integral of each hat function up to an instant."""
            u = np.clip((instant - after) / apart, -1.0, 1.0)
            return np.asarray(apart * (0.5 + u - 0.5 * u * np.abs(u)))

        return np.asarray(after), (under_hat(end) - under_hat(start)) / lasting

    def lasting_ms(self, view: View) -> float:
        """Return the exposure, ms: its own, else the datasheet's."""
        if self.exposure_ms is None:
            return 1e3 * float(view.datasheet.require("exposure_s"))
        return self.exposure_ms

    def longest_way_mm(self, view: View) -> float:
        """Return how far the sensor gets during an exposure at most."""
        step_s = np.diff(view.time_s)
        going = step_s > 0
        speed = np.abs(np.diff(view.travel_mm))[going] / step_s[going]
        return 1e-3 * self.lasting_ms(view) * float(np.max(speed, initial=0.0))

    @staticmethod
    def _widened(
        law: Law, view: View, ahead: Floats, shares: Floats, read_mm: Floats, reach_mm: float
    ) -> Floats:
        """Average on the way what other effects do at one place, on the level that is read."""
        spot = law.mean_mm - view.depth_mm
        if view.datasheet.triangulation_angle_deg is not None:
            spot = np.where(view.visible, spot, np.nan)  # else another level's light is read
        total, count = np.zeros(view.shape), np.zeros(view.shape)
        if np.any(np.nan_to_num(spot)):
            for step, share in zip(ahead, shares, strict=True):
                rows = np.arange(len(spot)) + step
                here, level = between_rows(spot, rows), between_rows(view.depth_mm, rows)
                own = np.isfinite(here) & (np.abs(level - read_mm) <= STEEPEST * reach_mm)
                total += share * np.where(own, here, 0.0)
                count += share * own
        return total / np.where(count > 0, count, 1.0)
