"""What no effect explains, kept as a free-form curve over its covariate: no physics, but usable."""

from collections.abc import Sequence

import numpy as np

from diagnosis.families import covariate_values
from diagnosis.finding import Finding
from diagnosis.linear import Fitted, solve_linear
from diagnosis.trials import crossfitted
from diagnosis.workspace import Model, Workspace, bootstrap_interval
from sensors.effects.base import Effect
from sensors.effects.empirical import Empirical
from sensors.typed_yaml import RecipeError
from sensors.view.covariates import COVARIATES

KNOTS = 9


def fit_empirical(ws: Workspace, model: Model, left: Sequence[Finding]) -> Effect | None:
    """Fit the curve over the one covariate that takes up most of what is left; None without any."""
    if not any(f.channel == "mean" for f in left):
        return None
    states = ws.states(ws.predict(model))
    best: tuple[float, Effect] | None = None
    for name in COVARIATES:
        if name in ("hidden",):
            continue
        try:
            values = covariate_values(name, ws.patches)
        except (RecipeError, ValueError):
            continue
        if values is None:
            continue
        known = np.concatenate([v[np.isfinite(v)] for v in values])
        knots = np.unique(
            0.5 * np.quantile(known, np.linspace(0, 1, KNOTS))
            + 0.5 * np.linspace(known.min(), known.max(), KNOTS)
        )
        if knots.size < 3:
            continue
        effect = Empirical(against=name, knots=tuple(map(float, knots)), values=(0.0,) * knots.size)
        fitted = solve_linear(effect, ws, states, ws.masks())
        if fitted is not None and (best is None or fitted.gain > best[0]):
            best = (fitted.gain, fitted.effect)
    if best is None or best[0] < 2 * KNOTS:
        return None
    # kept only where it pays on the half of the readings that it wasn't fitted to
    base = ws.log_densities(model)
    trial = Fitted(effect=best[1], own={}, gain=best[0], free=KNOTS)
    blocks = crossfitted(ws, model, Empirical, trial, base)
    low, _ = bootstrap_interval(blocks, np.random.default_rng(0))
    return best[1] if low > 0 else None
