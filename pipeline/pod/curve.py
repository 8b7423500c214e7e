"""What a probability-of-detection curve is, however it was fitted."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.stats import chi2

Floats = NDArray[np.float64]

CONFIDENCE: Final = 0.95
DROP: Final = float(chi2.ppf(2 * CONFIDENCE - 1, 1))
"""Twice the fall of the log likelihood at a one-sided 95 % bound (Wilks): 2.706."""

FARTHEST: Final = 20.0
"""How far from the estimate a bound is looked for, in ln size or in the link's units."""


class NotEstimable(ValueError):
    """The data don't determine a curve; why, in words. A result, not an error."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Estimate:
    """Sizes of a curve, in the unit of the sizes given.

    Attributes
    ----------
    a50, a90 : float
        Sizes that are detected with probability 0.5 and 0.9.
    a90_95 : float or None
        One-sided 95 % upper confidence bound of a90 by likelihood ratio; None where the
        likelihood doesn't fall far enough.
    """

    a50: float
    a90: float
    a90_95: float | None


class Curve(ABC):
    """A fitted curve POD(a), with bounds by profile likelihood.

    MIL-HDBK-1823A (2009), appendix G; the bounds after Cheng and Iles, Technometrics 25 (1983) 77.
    """

    @abstractmethod
    def pod(self, size: Floats) -> Floats:
        """Return the probability of detection at sizes of any shape."""

    @abstractmethod
    def size_at(self, pod: float) -> float:
        """Return the size that is detected with this probability."""

    @abstractmethod
    def fall(self, size: float, pod: float) -> float:
        """Return twice the fall of the log likelihood where the curve must pass this point."""

    def estimate(self) -> Estimate:
        """Return a50, a90 and a90/95."""
        a90 = self.size_at(0.9)
        return Estimate(a50=self.size_at(0.5), a90=a90, a90_95=self._upper(a90))

    def _upper(self, a90: float) -> float | None:
        start = float(np.log(a90))

        def over(log_size: float) -> float:
            return self.fall(float(np.exp(log_size)), 0.9) - DROP

        reach = 0.05
        while over(start + reach) < 0:
            reach *= 2
            if reach > FARTHEST:
                return None
        return float(np.exp(brentq(over, start, start + reach, xtol=1e-6)))

    def lower_pod(self, size: float) -> float:
        """Return the one-sided 95 % lower bound of POD at a size, pointwise."""
        best = float(self.pod(np.array(size)))

        def over(log_odds: float) -> float:
            return self.fall(size, 1 / (1 + np.exp(-log_odds))) - DROP

        at = float(np.clip(np.log(best) - np.log1p(-min(best, 1 - 1e-12)), -30, 30))
        if over(at) >= 0:  # so near 0 or 1 that rounding moves the curve
            return best
        reach = 0.25
        while over(at - reach) < 0:
            reach *= 2
            if reach > FARTHEST:
                return 0.0
        return float(1 / (1 + np.exp(-brentq(over, at - reach, at, xtol=1e-6))))
