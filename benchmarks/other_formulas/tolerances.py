"""Good instruments as they come from makers whose line, lens and finder differ.

What a well-made instrument scatters by depends on how much light a reading has, and the light
isn't even: the line is brighter in its middle and streaked, and in focus at one distance. Its
peak's position scatters by the root of the photons (Winick, J. Opt. Soc. Am. A 3 (1986) 1809) and
with the width of the peak; speckle doesn't depend on the light (Dorsch, Häusler & Herrmann, Appl.
Opt. 33 (1994) 1306):

    sd² / sd₀² = speckle + (1 - speckle) w² / S,     S = line(x) (z₀/z)²,
    w² = 1 + ((z - z₀) / reach)²

with the Gaussian beam's width w. None of it is a fault, and no sensor's file states it. What slopes
do to the noise is the part's affair: `incidence_noise`.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.other_formulas.cases import Case, nominal_shot, record, stage
from benchmarks.other_formulas.parts import PARTS, plate
from benchmarks.other_formulas.shot import Shot
from diagnosis.prepare import Inputs
from files.record import parse
from sensors.datasheet import Datasheet

Floats = NDArray[np.float64]
STREAKS = 4
"""Waves along the line that its unevenness is made of."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Tolerance:
    """What one instrument has of what instruments of its class may have.

    Attributes
    ----------
    speckle : share of the noise's variance that is speckle, in the middle of the range
    ends, middle : light at the line's ends over that in its middle; where that is, in half lines
    streaks : (k,) amplitude of each wave of the line's light; `turns`, `phases` its form
    reach : distance over which the line's width grows by √2, in half ranges
    outliers, missing : shares of readings
    """

    speckle: float
    ends: float
    middle: float
    streaks: Floats
    turns: Floats
    phases: Floats
    reach: float
    outliers: float
    missing: float

    def light(self, u: Floats) -> Floats:
        """Light of the line at a place along it, in half lines, over that of its middle."""
        waves = np.sin(np.pi * self.turns * u[..., None] + self.phases) @ self.streaks
        return np.asarray(self.ends ** np.square(u - self.middle) * np.exp(waves))


def draw_tolerance(rng: np.random.Generator) -> Tolerance:
    """Draw an instrument within what makers of line lasers and profilometers allow.

    A Powell lens makes a line that is even but for its streaks; a cylinder lens leaves a Gaussian,
    of which a sensor uses the middle: 30 to 100 % of the light are at the ends, and streaks have
    up to 15 % (rms). The working range ends where the line is out of focus by about its own width,
    or before. Stray light and dust take one reading in a thousand at worst.
    """
    return Tolerance(
        speckle=float(rng.uniform(0.3, 0.9)),
        ends=float(np.exp(rng.uniform(np.log(0.3), 0.0))),
        middle=float(rng.uniform(-0.2, 0.2)),
        streaks=rng.uniform(0.0, 0.15) * rng.normal(0, 1 / np.sqrt(STREAKS / 2), STREAKS),
        turns=rng.uniform(0.5, 6.0, STREAKS),
        phases=rng.uniform(0, 2 * np.pi, STREAKS),
        reach=float(rng.uniform(1.0, 3.0)),
        outliers=float(10 ** rng.uniform(-5.0, -3.0)),
        missing=float(10 ** rng.uniform(-5.0, -3.0)),
    )


def tolerated(shot: Shot, tolerance: Tolerance) -> Shot:
    """Give a recording the noise, the outliers and the losses of a good instrument."""
    view, sheet = shot.view, shot.view.instrument.sheet
    z0 = sheet.working_distance_mm
    z = np.nan_to_num(view.depth, nan=z0)
    signal = tolerance.light(2 * view.x / sheet.x_fov_mm) * (z0 / z) ** 2
    width = 1 + np.square((z - z0) / (tolerance.reach * sheet.z_range_mm / 2))
    variance = tolerance.speckle + (1 - tolerance.speckle) * width / np.maximum(signal, 0.01)

    def far(shape: tuple[int, int], rng: np.random.Generator) -> Floats:
        return rng.choice([-1.0, 1.0], shape) * 0.15 * np.exp(0.5 * rng.standard_normal(shape))

    return replace(
        shot, scale=np.sqrt(variance), p_missing=tolerance.missing,
        p_outlier=tolerance.outliers, outlier=far,
        noise=replace(shot.noise, share=tolerance.speckle),
    )  # fmt: skip


def good_instrument(seed: int) -> Inputs:
    """Make recordings of a part and a plate by an instrument within its tolerances."""
    rng = np.random.default_rng([seed, 39])
    name = sorted(PARTS)[seed % len(PARTS)]
    case = Case(name=f"good-{seed}", kind="null", formulas=(), wanted=0, part=name,
                baselines=False, plate=True, seed=int(rng.integers(2**31)))  # fmt: skip
    staged, tolerance = stage(case), draw_tolerance(rng)
    shots = [nominal_shot(staged, scan, k) for k, scan in enumerate(staged.scans)]
    plain = nominal_shot(staged, staged.plate_scan, 0, plate())
    return Inputs(
        recordings=[
            record(staged, tolerated(shot, tolerance), f"rec-{k}", k)
            for k, shot in enumerate(shots)
        ],
        vertices_mm=staged.scene.vertices_mm, faces=staged.scene.faces,
        datasheet=parse(Datasheet, staged.instrument.stated()),
        references=[record(staged, tolerated(plain, tolerance), "plate", 90)],
    )  # fmt: skip
