"""The sensor moves during the exposure: a box average along the travel and a shift."""

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from sensors.effects.effect import Effect
from sensors.effects.parameter import parameter
from sensors.effects.relaxed import Relaxed
from sensors.law import Law
from sensors.line.beam import listed_sd_mm, listed_shift_mm, read_beam
from sensors.line.line_operator import STEEPEST, Line, between_rows
from sensors.line.line_spread import LineSpread, line_spread
from sensors.view.view import Reason, View

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

SHARES = (0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0)
"""Starting exposures of a search, over the time between profiles."""
NOTHING_MM = 1e-9
"""Changes of the mean by other effects that count as zero, mm."""


@dataclass(frozen=True, kw_only=True, slots=True)
class MotionBlur(Effect):
    """Centroid of a line that travels during the exposure.

    Light is weighted by what a matt surface sends to the camera, as far as its density on the
    camera's rows exceeds the finder's threshold (sensors/line/peak_finder.py). Speckle makes the
    light flicker, so a reading scatters where the depth changes during the exposure.
    """

    name: ClassVar = "motion_blur"
    summary: ClassVar = (
        "The sensor travels during the exposure: edges are blurred along the travel, and readings "
        "lag by half the distance travelled."
    )
    equation: ClassVar = (
        "z_m = Σ L S V [z(y+d) + κ η cot θ] / Σ L S V, L the line over d = η + v t, t from 0 "
        "to t_exp, S cos β towards the camera; σ² = σ0² + f² var of z(y + v t)"
    )
    source: ClassVar = (
        "Convolution of a Gaussian line and a box, sensors/line/line_spread.py; "
        "Lambert's cosine law; "
        "shift v·t_exp/2, bias (v·t_exp)²/24 · ∂²z/∂y² beyond it; "
        "variance of a mean of N depths with random weights of relative scatter f √N; "
        "f v·t_exp ∂z/∂y / √12 on a slope"
    )
    statement: ClassVar = (
        "The sensor moves during an exposure of {exposure_ms:.2f} ms: edges are blurred along the "
        "travel{shifted}."
    )
    channels: ClassVar = ("mean", "variance")
    frame: ClassVar = "travel"
    covariate: ClassVar = "curvature_y"
    relaxed: ClassVar = (Relaxed(channel="mean", spanned=True),)
    rivals: ClassVar = ("finite_spot", "travel_ripple", "pose_error")
    separating: ClassVar = (
        "vary the speed: blur and shift grow with the speed; reverse the travel: the shift changes "
        "its sign"
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
        """Return exposures from a quarter of the time between profiles to six times that time.

        Each in steady light and in light that flickers as it usually does: at a step that decides
        how probable a reading is. The poses of a registered recording are those of the exposures'
        middle.
        """
        step_s = float(np.median(np.diff(view.time_s))) if len(view.time_s) > 1 else 0.0
        longest = self.parameter("exposure_ms").high
        times = [min(1e3 * share * step_s, longest) for share in SHARES if step_s > 0]
        flickers = (0.0, self.parameter("flicker").typical)
        return tuple(
            self.with_parameters(exposure_ms=t, flicker=f, stamped="middle")
            for t in times for f in flickers
        )  # fmt: skip

    def words(self) -> dict[str, str]:
        """Return the shift for the statement."""
        shifted = " and shifted by half the distance travelled"
        return {"shifted": shifted if self.stamped == "start" else ""}

    def changed(self, law: Law, view: View) -> Law:
        """Read the line blurred over the exposure, and add the scatter of the depths in it."""
        start, end = self.way_mm(view)
        way = np.abs(end - start)
        if not way.any():
            return law
        sd = listed_sd_mm(view)
        if np.ptp(start) + np.ptp(end) <= 1e-9 * way.max():
            start, end = start[:1], end[:1]
        moving = line_spread(sd, start, end)
        line = read_beam(view, moving)
        lit = _lit(line, view)
        mean = line.depth_mm + _beside(law, view, moving, line.depth_mm)
        still = line_spread(sd, 0.0, 0.0, step_mm=moving.step_mm)
        own: Floats | float = 0.0
        stood_lit = np.zeros(view.shape, dtype=bool)
        if sd > 0:
            stood = read_beam(view, still)
            stood_lit = _lit(stood, view)
            # the file's bias of a standing line beyond this reading decreases in a longer line
            less = np.sqrt(still.variance / moving.variance)[:, None]
            filed = view.depth_mm + listed_shift_mm(view)
            mean += _filed(filed - stood.depth_mm, line.depth_mm - stood.depth_mm, less, sd)
            # the noise of the law contains the spread of a standing line
            own = np.square(stood.spread_mm)
        wider = moving.variance - still.variance
        share = way**2 / 12 / np.where(wider > 0, wider, 1.0)
        spread = np.sqrt(np.fmax(np.square(line.spread_mm) - own, 0.0) * share[:, None])
        # a point that comes into view during the exposure is read
        hidden = (law.reason == Reason.HIDDEN_FROM_CAMERA) & ~stood_lit
        return replace(
            law,
            mean_mm=np.where(lit & (np.isfinite(law.mean_mm) | hidden), mean, law.mean_mm),
            reason=np.where(lit & hidden, np.uint8(Reason.VALID), law.reason),
            white_sd_mm=np.hypot(law.white_sd_mm, self.flicker * np.nan_to_num(spread)),
        )

    def way_mm(self, view: View) -> tuple[Floats, Floats]:
        """Return where each profile's exposure begins and ends from the stated pose, (n,) mm."""
        step_s = np.diff(view.time_s, append=2 * view.time_s[-1] - view.time_s[-2:-1])
        going = step_s > 0
        speed = np.where(going, view.travel_step_mm, 0.0) / np.where(going, step_s, 1.0)
        way = 1e-3 * self.lasting_ms(view) * speed
        start = -0.5 * way if self.stamped == "middle" else np.zeros_like(way)
        return start, start + way

    def lasting_ms(self, view: View) -> float:
        """Return the exposure, ms: the effect's, else the datasheet's."""
        if self.exposure_ms is None:
            return 1e3 * float(view.datasheet.require("exposure_s"))
        return self.exposure_ms

    def quieter(self, view: View) -> float:
        """Return the speckle's standard deviation over that of a standing line: about 2 s / way."""
        sd = listed_sd_mm(view)
        way = self.longest_way_mm(view)
        if sd == 0.0 or way == 0.0:
            return 1.0
        moving = line_spread(sd, -0.5 * way, 0.5 * way)
        still = line_spread(sd, 0.0, 0.0, step_mm=moving.step_mm)
        return float((moving.speckle / still.speckle)[0])

    def longest_way_mm(self, view: View) -> float:
        """Return the longest distance travelled during an exposure, mm."""
        start, end = self.way_mm(view)
        return float(np.max(np.abs(end - start)))


def _lit(line: Line, view: View) -> Mask:
    """Tell where enough of a line's light reaches the camera for a reading, (n, m)."""
    return np.asarray(np.isfinite(line.depth_mm) & (line.light >= view.sensor.beam.weakest))


def _filed(beyond_mm: Floats, change_mm: Floats, share: Floats, sd_mm: float) -> Floats:
    """Return what the file says beyond a matt standing line, as far as it holds of a moving one.

    Where the file has another level than that line reads, it holds until the exposure brings
    another level: a line that hardly moves reads what the file says.

    Parameters
    ----------
    change_mm : what the moving line reads beyond the standing one
    share : how much of a bias is left
    sd_mm : standard deviation of the standing line
    """
    biased = np.abs(beyond_mm) <= STEEPEST * sd_mm
    kept = np.where(np.abs(change_mm) <= STEEPEST * sd_mm, beyond_mm, 0.0)
    return np.where(biased, share * beyond_mm, kept)


def _beside(law: Law, view: View, line: LineSpread, read_mm: Floats) -> Floats:
    """Average over the line the bias by effects other than its width, on the level read."""
    other = law.mean_mm - view.depth_mm - listed_shift_mm(view)
    total, count = np.zeros(view.shape), np.zeros(view.shape)
    if np.nanmax(np.abs(other), initial=0.0) > NOTHING_MM:
        still = view.travel_step_mm == 0.0
        a_mm = np.where(still, 0.0, 1.0 / np.where(still, 1.0, view.travel_step_mm))
        reach = float(np.max(np.abs(line.offsets_mm)))
        for offset, light in zip(line.offsets_mm, line.light, strict=True):
            rows = np.arange(len(other)) + offset * a_mm
            here, level = between_rows(other, rows), between_rows(view.depth_mm, rows)
            own = np.isfinite(here) & (np.abs(level - read_mm) <= STEEPEST * reach)
            total += light[:, None] * np.where(own, here, 0.0)
            count += light[:, None] * own
    return total / np.where(count > 0, count, 1.0)
