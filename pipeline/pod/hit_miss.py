"""POD from hits and misses: a generalised linear model on the logarithm of the size.

MIL-HDBK-1823A (2009), appendix G: link(POD) = b0 + b1 ln a, by maximum likelihood.
"""

from dataclasses import dataclass
from typing import Final, Literal, Self

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, log_ndtr, logit, ndtr, ndtri

from pipeline.pod.curve import Curve, Floats, NotEstimable

Link = Literal["logit", "probit"]
STEPS: Final = 100
CLOSE: Final = 1e-10


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class HitMiss(Curve):
    """A fitted curve.

    Attributes
    ----------
    intercept, slope : float
        b0, and b1 per unit of ln size.
    link : "logit" or "probit"
    log_size, hit : (n,) arrays
        The data.
    """

    intercept: float
    slope: float
    link: Link
    log_size: Floats
    hit: NDArray[np.bool_]

    @classmethod
    def fit(cls, size: Floats, hit: NDArray[np.bool_], link: Link = "logit") -> Self:
        """Fit to sizes above zero and whether each flaw was found.

        Raises
        ------
        NotEstimable
            Where all are found or missed, sizes separate them, or POD doesn't rise with size.
        """
        x, y = np.log(np.asarray(size, dtype=np.float64)), np.asarray(hit, dtype=np.bool_)
        if y.all() or not y.any():
            raise NotEstimable(f"all of {y.size} flaws are {'found' if y.any() else 'missed'}")
        if x[~y].max() <= x[y].min():
            raise NotEstimable(
                f"every flaw above {np.exp(x[y].min()):.3g} is found and every one below missed:"
                " the likelihood has no maximum"
            )
        centre = x.mean()
        design = np.stack([np.ones_like(x), x - centre], axis=1)
        level, slope = _fit(design, np.zeros_like(x), y, link)
        if slope <= 0:
            raise NotEstimable("the probability of detection doesn't rise with size")
        return cls(
            intercept=float(level - slope * centre), slope=float(slope), link=link, log_size=x,
            hit=y,
        )  # fmt: skip

    def pod(self, size: Floats) -> Floats:
        """Return the probability of detection at sizes of any shape."""
        eta = self.intercept + self.slope * np.log(size)
        return np.asarray(expit(eta) if self.link == "logit" else ndtr(eta))

    def size_at(self, pod: float) -> float:
        """Return the size that is detected with this probability."""
        return float(np.exp((_quantile(pod, self.link) - self.intercept) / self.slope))

    def fall(self, size: float, pod: float) -> float:
        """Return twice the fall of the log likelihood where the curve must pass this point."""
        x = self.log_size - np.log(size)
        through = np.full_like(x, _quantile(pod, self.link))
        (slope,) = _fit(x[:, None], through, self.hit, self.link)
        best = self.intercept + self.slope * self.log_size
        held = through + slope * x
        return 2 * float(_log_likelihood(best, self.hit, self.link)
                         - _log_likelihood(held, self.hit, self.link))  # fmt: skip


def _quantile(pod: float, link: Link) -> float:
    return float(logit(pod) if link == "logit" else ndtri(pod))


def _log_likelihood(eta: Floats, hit: NDArray[np.bool_], link: Link) -> float:
    signed = np.where(hit, eta, -eta)
    return float(np.sum(-np.logaddexp(0, -signed) if link == "logit" else log_ndtr(signed)))


def _fit(design: Floats, offset: Floats, hit: NDArray[np.bool_], link: Link) -> Floats:
    """Maximise the likelihood of offset + design @ b by Fisher scoring with halved steps."""
    b = np.zeros(design.shape[1])
    value = _log_likelihood(offset, hit, link)
    for _ in range(STEPS):
        eta = offset + design @ b
        score, weight = _score(eta, hit, link)
        step = np.linalg.solve(
            design.T @ (weight[:, None] * design) + CLOSE * np.eye(b.size), design.T @ score
        )
        scale = 1.0
        while scale > CLOSE:
            new = _log_likelihood(offset + design @ (b + scale * step), hit, link)
            if new >= value:
                break
            scale /= 2
        b = b + scale * step
        if new - value < CLOSE:
            break
        value = new
    return np.asarray(b)


def _score(eta: Floats, hit: NDArray[np.bool_], link: Link) -> tuple[Floats, Floats]:
    """Return the derivative of the log likelihood by eta, and the expected information."""
    if link == "logit":
        p = expit(eta)
        return hit - p, np.maximum(p * (1 - p), 1e-12)
    log_density = -0.5 * eta**2 - 0.5 * np.log(2 * np.pi)
    signed = np.where(hit, eta, -eta)
    score = np.where(hit, 1.0, -1.0) * np.exp(log_density - log_ndtr(signed))
    information = np.exp(2 * log_density - log_ndtr(eta) - log_ndtr(-eta))
    return score, np.maximum(information, 1e-12)
