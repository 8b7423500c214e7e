"""POD from the size of a signal: a censored regression of ln response on ln size.

MIL-HDBK-1823A (2009), appendix G ("â versus a"): ln â = b0 + b1 ln a + e, e normal with standard
deviation δ; responses at or below the floor are known to be no larger than it. A flaw is found
where â exceeds the decision threshold, so that POD(a) = Φ((b0 + b1 ln a - ln threshold) / δ).
"""

from dataclasses import dataclass
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import log_ndtr, ndtr, ndtri

from pipeline.pod.curve import Curve, Floats, NotEstimable

LEAST: Final = 4  # responses above the floor, of at least two sizes


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class SignalResponse(Curve):
    """A fitted curve.

    Attributes
    ----------
    intercept, slope, sd : float
        b0, b1 and δ.
    log_threshold : float
        ln of the decision threshold.
    log_size, log_response : (n,) arrays
        The data; what is censored has the floor.
    censored : (n,) bool
    """

    intercept: float
    slope: float
    sd: float
    log_threshold: float
    log_size: Floats
    log_response: Floats
    censored: NDArray[np.bool_]

    @classmethod
    def fit(cls, size: Floats, response: Floats, *, threshold: float, floor: float) -> Self:
        """Fit to sizes above zero and responses; those that are missing are NaN.

        Raises
        ------
        NotEstimable
            Where too few responses lie above the floor, or they don't rise with size.
        """
        x = np.log(np.asarray(size, dtype=np.float64))
        censored = ~(np.asarray(response) > floor)
        y = np.log(np.where(censored, floor, response))
        kept = ~censored
        if kept.sum() < LEAST or np.ptp(x[kept]) == 0:
            raise NotEstimable(f"{int(kept.sum())} responses above the floor of {floor:g}")
        line = np.polynomial.Polynomial.fit(x[kept], y[kept], 1).convert().coef
        sd = max(float(np.std(y[kept] - line[0] - line[1] * x[kept])), 1e-3)
        found = _minimise(
            lambda b: -_log_likelihood(b[0] + b[1] * x, np.exp(b[2]), y, censored),
            [line[0], line[1], np.log(sd)],
        )
        if found[1] <= 0:
            raise NotEstimable("the response doesn't rise with size")
        return cls(
            intercept=float(found[0]), slope=float(found[1]), sd=float(np.exp(found[2])),
            log_threshold=float(np.log(threshold)), log_size=x,
            log_response=y, censored=censored,
        )  # fmt: skip

    def pod(self, size: Floats) -> Floats:
        """Return the probability of detection at sizes of any shape."""
        mean = self.intercept + self.slope * np.log(size)
        return np.asarray(ndtr((mean - self.log_threshold) / self.sd))

    def size_at(self, pod: float) -> float:
        """Return the size that is detected with this probability."""
        wanted = self.log_threshold + ndtri(pod) * self.sd
        return float(np.exp((wanted - self.intercept) / self.slope))

    def fall(self, size: float, pod: float) -> float:
        """Return twice the fall of the log likelihood where the curve must pass this point."""
        x, z = self.log_size - np.log(size), float(ndtri(pod))

        def loss(b: Any) -> float:
            sd = np.exp(b[1])
            mean = self.log_threshold + z * sd + b[0] * x
            return -_log_likelihood(mean, sd, self.log_response, self.censored)

        held = _minimise(loss, [self.slope, np.log(self.sd)])
        mean = self.intercept + self.slope * self.log_size
        best = _log_likelihood(mean, self.sd, self.log_response, self.censored)
        return 2 * (best + loss(held))


def _log_likelihood(mean: Floats, sd: float, y: Floats, censored: NDArray[np.bool_]) -> float:
    z = (y - mean) / sd
    return float(np.sum(np.where(censored, log_ndtr(z), -0.5 * z**2 - np.log(sd))))


def _minimise(loss: Any, start: list[float]) -> Floats:
    found = minimize(loss, start, method="Nelder-Mead",
                     options={"xatol": 1e-7, "fatol": 1e-9, "maxiter": 4000})  # fmt: skip
    return np.asarray(found.x)
