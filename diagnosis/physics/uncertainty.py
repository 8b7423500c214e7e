"""95 % intervals of parameters: the sandwich of an M-estimator, one way for all that is fitted.

θ is estimated by the maximum of the log density Σ_b l_b of blocks of readings that count as
independent, each recording's placement and the noise's level profiled out. Then

    cov θ = A⁻¹ B A⁻¹,   A = -∂²Σl_b/∂θ²,   B = n/(n - p) Σ_b s_b s_b',   s_b = ∂l_b/∂θ

(Huber, Proc. 5th Berkeley Symp. (1967) 221; White, Econometrica 50 (1982) 1), whatever the noise
is, and an interval reaches t(0.975, n - p) deviations to each side. A phase of a recording is a
parameter like any other: a frequency is known the less for it. A strength is that of the fault and
of what a good instrument has of its kind: the spread of good ones (evidence/usual_share.py) adds in
quadrature. `benchmarks/coverage.py` measures how often the intervals hold the truth. What lives on
depth edges has none: there it failed.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from diagnosis.fields import Field
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.physics.curvature import Quadratic, fitted_numbers, quadratic

LEVEL = 0.95
ROUNDS = 3
WORTH = 0.02
"""Nats below which a step towards the maximum isn't taken: a seventh of a deviation."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Estimate:
    """A parameter's value and its 95 % interval, where one was computed."""

    value: float
    low: float | None = None
    high: float | None = None

    def as_json(self) -> dict[str, float]:
        """Return the entry of diagnosis.json; without an interval it has no `low` and `high`."""
        ends = {"low": self.low, "high": self.high}
        return {"value": self.value, **{k: v for k, v in ends.items() if v is not None}}


Intervals = dict[str, dict[str, Estimate]]


def intervals(ws: Workspace, model: Model, unsure: Mapping[str, float]) -> Intervals:
    """Estimate each number that the recordings share, by effect; model at the best fit.

    Parameters
    ----------
    unsure : relative standard deviation of each effect's strength by what good instruments have
    """
    out: Intervals = {
        e.name: {n: Estimate(value=float(getattr(e, n))) for n in fitted_numbers(e)}
        for e in model.effects
    }
    about = quadratic(ws, model)
    if about is None:
        return out
    sd = np.sqrt(np.diag(sandwich(about.slopes, about.curvature))) * about.steps
    dof = max(about.slopes.shape[1] - len(about.numbers), 1)
    reach = float(stdtrit(dof, 0.5 + LEVEL / 2))
    total = np.hypot(sd, _by_good_ones(about, model, unsure))
    for number, half in zip(about.numbers, reach * total, strict=True):
        if number.recording is not None:
            continue
        value = number.value(model)
        p = number.kind(model).parameter(number.name)
        low, high = (-np.inf, np.inf) if number.is_phase else (p.low, p.high)
        out[number.effect][number.name] = Estimate(
            value=value, low=float(max(value - half, low)), high=float(min(value + half, high))
        )
    return out


def _by_good_ones(about: Quadratic, model: Model, unsure: Mapping[str, float]) -> Field:
    """Return the deviation of each number by what good instruments have: 0 but of strengths.

    An effect's strengths θ change readings by the energy θ'Aθ; a share of its root may be another's
    that one of them takes up alone.
    """
    out = np.zeros(len(about.numbers))
    information = about.curvature / np.outer(about.steps, about.steps)
    for effect, share in unsure.items():
        at = [
            k for k, n in enumerate(about.numbers)
            if n.effect == effect and n.kind(model).parameter(n.name).linear
        ]  # fmt: skip
        strengths = np.array([about.numbers[k].value(model) for k in at])
        own = information[np.ix_(at, at)]
        out[at] = share * np.sqrt(max(float(strengths @ own @ strengths), 0.0) / np.diag(own))
    return out


def refined(ws: Workspace, model: Model) -> Model:
    """Move all numbers together to the maximum of the log density, by Newton's steps."""
    for _ in range(ROUNDS):
        about = quadratic(ws, model)
        if about is None or about.to_gain < WORTH:
            return model
        moved = about.climbed(ws, model, ws.masks())
        if moved is model:
            return model
        model = moved
    return model


def sandwich(slopes: Field, curvature: Field) -> Field:
    """Covariance A⁻¹ B A⁻¹ of parameters.

    Parameters
    ----------
    slopes : (p, n) score of each block
    curvature : (p, p) A, minus the Hessian of the sum
    """
    count, blocks = slopes.shape
    inverse = np.linalg.inv(curvature)
    meat = slopes @ slopes.T * (blocks / max(blocks - count, 1))
    return np.asarray(inverse @ meat @ inverse)


def plain_values(values: Mapping[str, float]) -> dict[str, Estimate]:
    """Estimates without intervals."""
    return {name: Estimate(value=value) for name, value in values.items()}
