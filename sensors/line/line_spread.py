"""A laser line that moves on while it is exposed: where on the surface its light falls.

Light that falls at a displacement d from the stated place left the line's middle at u, when the
sensor was there, and lies η = d - u across the line. Over the exposure

    L(d) = ∫ G(d - u) du / (b - a), u from a to b,    L(d) <η>(d) = ∫ η G(d - u) du / (b - a)

with G the line's Gaussian profile: one line of another shape, whose light the camera's lean moves
by <η> instead of d. Both are integrated in closed form against the hat functions of a grid, so a
line without width is served, too, and a grid much coarser than the line isn't needed.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtr

Floats = NDArray[np.float64]
Integral = Callable[[Floats, float], Floats]

FEWEST_STEPS = 8
"""Steps that the way of a line without width is divided into at least, twice that at most."""
CUT = 4.0
"""Standard deviations at which a Gaussian ends."""
LEAST_LIGHT = 1e-12
"""Share of the light below which its position in the line is undefined."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class LineSpread:
    """Light of a moving line over displacements.

    Attributes
    ----------
    offsets_mm : (k,) displacements from the stated place, multiples of a power of two
    light : (k, n) share of a profile's light that each stands for
    within_mm : (k, n) where across the line it lies on average
    sd_mm : standard deviation of the line across its width
    """

    offsets_mm: Floats
    light: Floats
    within_mm: Floats
    sd_mm: float

    @property
    def step_mm(self) -> float:
        """Step of the grid."""
        return float(self.offsets_mm[1] - self.offsets_mm[0])

    @property
    def variance(self) -> Floats:
        """Second central moment of the light over the displacements, (n,) mm²."""
        middle = self.offsets_mm @ self.light
        return np.asarray(np.square(self.offsets_mm) @ self.light - middle**2)

    @property
    def speckle(self) -> Floats:
        """Size of what speckle does to the centre of gravity, (n,), up to a factor of the line's.

        Speckle at d moves the centre by <η> L(d). Over the middle of a long way all of the line
        passes and <η> is nought: only where the exposure begins and ends is anything left.
        """
        return np.asarray(np.sqrt(np.sum(np.square(self.light * self.within_mm), axis=0)))


def line_spread(
    sd_mm: float, start_mm: ArrayLike, end_mm: ArrayLike, step_mm: float | None = None
) -> LineSpread:
    """Blur a line over its path during the exposure.

    Parameters
    ----------
    sd_mm : standard deviation of the line across its width, 0 for none
    start_mm, end_mm : (n,) or float
        Displacements at which each profile's exposure begins and ends.
    step_mm : step of the grid; about the line's width or a part of the way where left out
    """
    a, b = np.broadcast_arrays(np.atleast_1d(start_mm), np.atleast_1d(end_mm))
    a, b = np.minimum(a, b).astype(np.float64), np.maximum(a, b).astype(np.float64)
    h = step_between(sd_mm, float(np.max(b - a))) if step_mm is None else step_mm
    first = math.floor((a.min() - CUT * sd_mm) / h)
    last = math.ceil((b.max() + CUT * sd_mm) / h)
    d = h * np.arange(first, last + 1)[:, None]
    # the hat adds h²/6 to the variance of what it samples
    narrow = math.sqrt(max(sd_mm**2 - h**2 / 6, 0.0))
    way = b - a
    goes = way > 1e-6 * h
    length = np.where(goes, way, 1.0) * h

    def from_to(integral: Integral) -> Floats:
        return _bend(integral, d - a, narrow, h) - _bend(integral, d - b, narrow, h)

    light = np.where(goes, from_to(_third) / length, _bend(_second, d - a, narrow, h) / h)
    moment = np.where(goes, -(sd_mm**2) * from_to(_second) / length, light * (d - a))
    light = light / light.sum(axis=0)
    known = light > LEAST_LIGHT
    within = np.where(known, moment / np.where(known, light, 1.0), 0.0)
    return LineSpread(offsets_mm=d[:, 0], light=light, within_mm=within, sd_mm=sd_mm)


def step_between(sd_mm: float, way_mm: float) -> float:
    """Return a power of two that divides the line, or the way, finely enough.

    So a search over exposures meets the same displaced views again.
    """
    return float(2.0 ** math.floor(math.log2(max(sd_mm, way_mm / FEWEST_STEPS, 1e-6))))


def _second(x: Floats, sd: float) -> Floats:
    """Second integral of the Gaussian density up to x."""
    if sd == 0.0:
        return np.maximum(x, 0.0)
    return np.asarray(x * ndtr(x / sd) + sd * _density(x / sd))


def _third(x: Floats, sd: float) -> Floats:
    """Third integral of the Gaussian density up to x."""
    if sd == 0.0:
        return 0.5 * np.square(np.maximum(x, 0.0))
    return np.asarray(0.5 * ((x**2 + sd**2) * ndtr(x / sd) + sd * x * _density(x / sd)))


def _density(u: Floats) -> Floats:
    return np.asarray(np.exp(-0.5 * u**2) / math.sqrt(2 * math.pi))


def _bend(integral: Integral, x: Floats, sd: float, step: float) -> Floats:
    """Second difference: what a hat function of that half width collects."""
    return integral(x + step, sd) - 2 * integral(x, sd) + integral(x - step, sd)
