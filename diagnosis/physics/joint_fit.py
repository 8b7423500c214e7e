"""The full laws of named causes, fitted on the readings from where their components point."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from diagnosis.components.component import Component
from diagnosis.evidence.reported_causes import Cause
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.physics.effect_fit import fit_effect
from diagnosis.physics.linear_fit import Fitted, is_linear
from diagnosis.predict.prediction import starting
from diagnosis.settings import SETTINGS
from sensors.effects import CATALOGUE
from sensors.effects.base import Effect


def fit_laws(
    causes: Sequence[Cause],
    ws: Workspace,
    model: Model,
    *,
    polish: bool = True,
    known: Mapping[str, Fitted] | None = None,
) -> tuple[Model, list[Cause]]:
    """Add the law of each cause to a model, strongest first, then refit all together.

    Parameters
    ----------
    polish : search beyond the laws' grids; otherwise the best points of the grids stand
    known : laws that have been fitted beside this model

    Returns
    -------
    model, and the causes with a doubt about laws that don't fit
    """
    few = ws.thin(SETTINGS.fitted_readings)
    looked_at = few.count() / max(ws.count(), 1)
    out = []
    for cause in causes:
        fitted = (known or {}).get(cause.name)
        if fitted is None:
            fitted = fit_law(cause, few, model, polish=polish)
        if fitted is None or fitted.effect.is_null:
            out.append(cause.doubted("Its law doesn't fit these recordings."))
            continue
        if fitted.gain < SETTINGS.explained_share * looked_at * cause.gain:
            cause = cause.doubted(
                f"Its law gains {max(fitted.gain, 0.0):.0f} nats where a free curve gains "
                f"{looked_at * cause.gain:.0f}: the formula may be another."
            )
        model = few.levelled(model.with_effect(fitted.effect, fitted.own))
        out.append(cause)
    if polish and len(model.effects) > 1:
        model = refit(few, model)
    return refit_linear(ws, model), out


def fit_law(
    cause: Cause, ws: Workspace, model: Model, *, polish: bool = True, at_edges: bool = False
) -> Fitted | None:
    """Fit one law beside a model; None where it can't act on these recordings.

    Parameters
    ----------
    at_edges : as a law of light and edges alone
    """
    kind = CATALOGUE[cause.name]
    states = ws.states(ws.predict(model))
    starts: list[Effect | None] = [None]
    if cause.repeats > 0 and cause.component is not None:
        relaxed = cause.component.relaxed
        value = {relaxed.frequency: cause.repeats, relaxed.period: 1 / cause.repeats}
        value.pop("", None)
        base = starting(kind, ws.patches[0].view)
        starts = [
            base.with_parameters({name: float(np.clip(v, p.low, p.high))})
            for name, v in value.items()
            for p in [base.parameter(name)]
        ] or starts
    found = [
        fit_effect(kind, ws, model, states, start=start, polish=polish, at_edges=at_edges)
        for start in starts
    ]
    return max((f for f in found if f is not None), key=lambda f: f.gain, default=None)


def strongest_law(causes: Sequence[Cause], ws: Workspace, model: Model) -> Cause:
    """Return the cause whose law alone, at a point of its grid, makes the readings most probable.

    Where a signal is many times the noise, free curves share it in ways that no law could.
    """
    few = ws.thin(SETTINGS.fitted_readings)

    def gain(cause: Cause) -> float:
        fitted = fit_law(cause, few, model, polish=False)
        return -np.inf if fitted is None else fitted.gain - fitted.free

    return max(causes, key=gain)


def among_laws(
    cause: Cause,
    others: Sequence[Component],
    ws: Workspace,
    model: Model,
    *,
    known: Mapping[str, Fitted] | None = None,
) -> tuple[Cause, float, dict[str, Fitted]]:
    """Name a cause that was weighed by the span of its law by laws as they are fitted.

    A law at points of its grid isn't the law: what several laws at edges do there is alike. Each is
    fitted; a law of another formula than nature's falls short by a share of what it gains, so that
    gains which differ by less tell nothing. With each law the
    noise, and that at edges, is as large as suits.

    Parameters
    ----------
    others : components of the other laws that may be in its place
    known : laws that have been fitted beside this model

    Returns
    -------
    the cause, what its law gains, nats, and the laws as they are fitted
    """
    few = ws.thin(SETTINGS.fitted_readings)
    components = {c.effect: c for c in (cause.component, *others) if c is not None}

    def law(name: str, *, polish: bool) -> Fitted | None:
        # in another law's place a part's form is what it is at edges
        found = fit_law(
            replace(cause, name=name, repeats=0.0), few, model, polish=polish,
            at_edges=name != cause.name,
        )  # fmt: skip
        return None if found is None or found.effect.is_null else found

    fitted = {n: f for n, f in (known or {}).items() if n in components}
    for name in sorted(components.keys() - fitted):
        rough = law(name, polish=False)
        # a point of the grid that gains little tells nothing of what a search gains from there
        if rough is not None and (name == cause.name or rough.gain > 0):
            fitted[name] = law(name, polish=True) or rough
    without = few.most_probable(model)
    gains = {
        n: few.most_probable(model.with_effect(f.effect, f.own)) - without - f.free
        for n, f in fitted.items()
    }  # fmt: skip
    best = max(gains.values(), default=0.0)
    if gains.get(cause.name, 0.0) <= 0:
        return cause, 0.0, fitted  # its own law does nothing: no other stands in for it
    apart = 1.0 + SETTINGS.doubt_of_laws * best
    likely = {name: np.exp((gain - best) / apart) for name, gain in gains.items()}
    named = {cause.name: cause.probability, **dict(cause.alternatives)}
    together = sum(p for n, p in named.items() if n in components)
    total = sum(likely.values())
    shares = {n: p for n, p in named.items() if n not in components}
    shares |= {n: float(together * p / total) for n, p in likely.items()}
    order = sorted(shares, key=lambda n: -shares[n])
    return replace(
        cause, name=order[0], component=components.get(order[0]), probability=shares[order[0]],
        nats=max(cause.nats, float(gains.get(order[0], 0.0))),
        alternatives=tuple((n, shares[n]) for n in order[1:] if shares[n] > SETTINGS.offered),
    ), gains.get(order[0], best), fitted  # fmt: skip


def refit(ws: Workspace, model: Model) -> Model:
    """Refit each effect in turn with the others in place."""
    for effect in model.effects:
        rest = model.refitting(effect.name)
        fitted = fit_effect(
            type(effect), ws, rest, ws.states(ws.predict(rest)), start=effect.shared(), polish=True
        )
        if fitted is not None and not fitted.effect.is_null:
            model = ws.levelled(rest.with_effect(fitted.effect, fitted.own))
    return model


def refit_linear(ws: Workspace, model: Model) -> Model:
    """Solve each effect's linear part on all readings, the others in place."""
    for effect in model.effects:
        rest = model.refitting(effect.name)
        if not is_linear(effect, ws):
            continue
        fitted = fit_effect(
            type(effect), ws, rest, ws.states(ws.predict(rest)), start=effect, polish=False
        )
        if fitted is not None and not fitted.effect.is_null:
            model = rest.with_effect(fitted.effect, fitted.own)
    return ws.levelled(model)
