"""Selection: which effects, by the density of readings that took no part in the fit.

Forward: the effect whose cross-fitted gain is largest joins, as long as its block-bootstrap
interval excludes zero and the screening still finds something. Then all are refitted together,
and what no longer pays is dropped. Rivals within the uncertainty of the choice are kept beside it.
"""

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from diagnosis.edges import BESIDE_EDGES, on_edges
from diagnosis.families import effect_families, fillet_families, free_families
from diagnosis.finding import Finding, Screening
from diagnosis.fit import fit_effect
from diagnosis.linear import is_linear
from diagnosis.noise import Field
from diagnosis.rates import screen_rates
from diagnosis.screen import screen_mean
from diagnosis.trials import Trials
from diagnosis.workspace import Model, Workspace, bootstrap_interval
from sensors.effects import CATALOGUE

MOST = 4
RIVAL_SHARE = 0.5
LEAST_GAIN = 1e-3
"""Nats per held-out reading below which an effect is of no use: 0.045 of the noise.

The means of instruments that are as their maker says were up to 0.04 off.
"""
EQUAL = 0.99
"""Share of the best effect's gain from which another one, if it isn't surely worse, is as good.

Or if it is surely worse, by less than `LEAST_GAIN`.
"""
IDLE = 8.0
"""Nats below which a further effect isn't worth its name."""
LEAST_SHARE = 0.015
"""A further effect that gains less than this share of those before mends their remainder."""
UNSEARCHED_SHARE = 0.1
"""Share of the least gain below which a coarse trial isn't worth a search."""
SUSPECT_GAIN = 0.01
"""Nats per reading that an effect must gain where findings are within their tolerance."""
SEARCHED_READINGS = 80_000
SCREENED_READINGS = 180_000
NOT_SEARCHED = {
    "pose_error", "empirical", "roughness_level", "anisotropic_lay",
    "onboard_filter", "row_repeat", "axis_quantisation", "light_falloff", "lateral_error",
}  # fmt: skip
"""Effects that other tests cover; and those not yet told from rivals: over a round bar the place
along the line stands in for the angle, as which `light_falloff` took the place of a lobe's."""
LAST_RESORT = {"form_error", "column_offset"}
"""Flexible shapes: chosen only where no more specific effect does nearly as well."""
KIN = (
    {"finite_spot", "edge_mixing", "motion_blur"},
    {"volume_scattering", "incidence_bias"},
    {"specular_dropout", "incidence_noise"},
)
"""Approximations of one and the same thing: a second of them would mend the first's remainder.

What comes back of a light that is mostly too weak is noisy, too.
"""
Progress = Callable[[str], None]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Choice:
    """One effect that was chosen.

    Attributes
    ----------
    blocks : cross-fitted gain of each block, nats
    alternatives : (name, gain) of rivals within the uncertainty
    """

    name: str
    gain: float
    blocks: Field
    alternatives: tuple[tuple[str, float], ...]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Selection:
    """Outcome: the model, why, and what is left."""

    model: Model
    choices: tuple[Choice, ...]
    first: Screening
    last: Screening


def screen(
    ws: Workspace, model: Model, rng: np.random.Generator, withheld: Iterable[str]
) -> Screening:
    """All channels' findings beyond a model."""
    predictions = ws.predict(model)
    states = ws.states(predictions)
    families = itertools.chain(
        free_families(ws.patches),
        effect_families(
            ws.patches, predictions, ws.noise, accepted=model.effects, withheld=withheld
        ),
        fillet_families(ws.patches, model.effects, withheld),
    )
    mean = screen_mean(ws.patches, states, families, ws.noise, rng)
    rates = screen_rates(
        ws.patches, predictions, states, ws.noise, ws.block, model.effects
    )
    findings = sorted([*mean.findings, *rates], key=lambda f: -f.z)
    return Screening(findings=tuple(findings), threshold=mean.threshold)


def select(
    ws: Workspace,
    rng: np.random.Generator,
    *,
    withheld: Iterable[str] = (),
    progress: Progress = lambda text: None,
    start: Selection | None = None,
) -> Selection:
    """Choose effects until nothing significant is left or nothing more pays.

    Parameters
    ----------
    start : choices to go on from, none of them withheld
    """
    withheld = set(withheld)
    if start is None:
        progress("looking for mismatches")
        model, choices = Model(), []
        first = last = screen(ws, model, rng, withheld)
    else:
        model, choices, first = start.model, list(start.choices), start.first
        last = screen(ws.thin(SCREENED_READINGS), model, rng, withheld)
    few = ws.thin(SEARCHED_READINGS)
    while len(choices) < MOST:
        step, trials = None, Trials(ws=few, model=model)
        for findings, each in ((last.significant(), 0.0), (last.suspect(), SUSPECT_GAIN)):
            if findings and step is None:
                progress(f"explaining: {findings[0].name}")
                least = max(LEAST_SHARE * sum(c.gain for c in choices), each * few.count())
                step = _best(trials, findings, rng, withheld, least)
                if step is not None and step[1].gain < least:
                    step = None
        if step is None:
            break
        model, choice = step
        choices.append(choice)
        model = refit_linear(ws, model)
        last = screen(ws.thin(SCREENED_READINGS), model, rng, withheld)
    model, choices = _prune(few, model, choices, rng)
    model = refit_linear(ws, model)
    return Selection(model=model, choices=tuple(choices), first=first, last=last)


def _best(
    trials: Trials,
    findings: Sequence[Finding],
    rng: np.random.Generator,
    withheld: set[str],
    least: float = 0.0,
) -> tuple[Model, Choice] | None:
    """Return the model with the effect that explains most, if any is sure to.

    Parameters
    ----------
    least : nats below which an effect won't be chosen
    """
    ws, model = trials.ws, trials.model
    channels = {f.channel for f in findings}
    edges = any(f.family.at_edges if f.family else f.channel == "missing" for f in findings)
    waiting: set[str] = set()
    if "mean" in channels:
        # a misfit of the mean looks like spikes and like noise: those wait until it is explained
        waiting = {"variance", "tails", "correlation"}
    elif "tails" in channels:
        channels.add("mean")
    shown = channels - {"mean", "missing"}
    found = {f.family.effect.name for f in findings if f.family and f.family.effect}
    quick: list[tuple[float, str]] = []
    for name, kind in CATALOGUE.items():
        only = channels & set(kind.channels)
        if found & set(kind.rivals):
            # what it does besides looks like that: a gloss that loses no reading
            only |= channels & set(kind.also)
        if (
            name in NOT_SEARCHED | withheld
            or name in model.names()
            or any(name in kin and kin & set(model.names()) for kin in KIN)
            or not only - waiting
            or (on_edges(kind) and not edges and not shown & _of_kin(name))
        ):
            continue
        fitted = trials.fitted(name, polish=False)
        if fitted is not None and np.isfinite(fitted.gain) and not fitted.effect.is_null:
            quick.append((fitted.gain - fitted.free, name))
    quick.sort(reverse=True)
    worth = max(3.0, 0.2 * quick[0][0], UNSEARCHED_SHARE * least) if quick else 0.0
    shortlist = [n for g, n in quick if g > worth][:6]
    candidates: dict[str, tuple[Model, Field]] = {}
    free: dict[str, int] = {}
    for name in shortlist:
        fitted = trials.fitted(name, polish=True)
        if fitted is not None:
            candidates[name] = trials.judged(name, fitted)
            free[name] = fitted.free
    # what gains most may owe that to few blocks and lose in others
    sure = [
        name
        for name, (_, blocks) in candidates.items()
        if float(blocks.sum()) >= 4 and bootstrap_interval(blocks, rng)[0] > 0
    ]
    if not sure:
        return None
    order = sorted(sure, key=lambda n: -float(candidates[n][1].sum()))
    best = order[0]
    # a flexible shape gives way to a specific effect that does nearly as well
    if best in LAST_RESORT:
        for name in order[1:]:
            gain, top = float(candidates[name][1].sum()), float(candidates[best][1].sum())
            if name not in LAST_RESORT and gain > 0.85 * top:
                best = name
                break
    # of two that do equally well the one with fewer numbers: a law of many imitates a constant
    for name in order:
        less, most = candidates[name][1], candidates[best][1]
        more = most - less
        equal = float(less.sum()) > EQUAL * float(most.sum())
        little = float(more.sum()) < LEAST_GAIN * ws.count()
        if free[name] < free[best] and equal and (little or bootstrap_interval(more, rng)[0] <= 0):
            best = name
    trial, blocks = candidates[best]
    gain = float(blocks.sum())
    rivals = []
    for name in order:
        if name == best:
            continue
        other = candidates[name][1]
        difference = blocks - other
        spread = float(np.sqrt(np.sum((difference - difference.mean()) ** 2)))
        close = float(other.sum()) > max(3.0, RIVAL_SHARE * gain)
        if close and float(difference.sum()) < max(2 * spread, 2.0):
            rivals.append((name, float(other.sum())))
    return trial, Choice(name=best, gain=gain, blocks=blocks, alternatives=tuple(rivals))


def _of_kin(name: str) -> set[str]:
    """Return the channels of an effect and of those that approximate the same thing."""
    names = {name}.union(*(kin for kin in KIN if name in kin))
    return set().union(*(CATALOGUE[other].channels for other in names))


def refit(ws: Workspace, model: Model, *, rounds: int = 1) -> Model:
    """Refit each effect in turn with the others in place."""
    if not model.effects:
        return model
    for _ in range(rounds):
        for effect in model.effects:
            rest = model.without(effect.name)
            predictions = ws.predict(rest)
            states = ws.states(predictions)
            # chosen by a few flats that may tell little more than which of them are dark
            anew = effect.covariate in BESIDE_EDGES
            fitted = fit_effect(
                type(effect), ws, rest, predictions, states, masks=ws.masks() if anew else None,
                start=None if anew else effect.shared(), polish=True,
            )  # fmt: skip
            if fitted is not None and not fitted.effect.is_null:
                model = ws.levelled(rest.with_effect(fitted.effect, fitted.own))
    return model


def refit_linear(ws: Workspace, model: Model) -> Model:
    """Solve each effect's linear part on all readings, the others in place."""
    for effect in model.effects:
        rest = model.without(effect.name)
        if not is_linear(effect, ws):
            continue
        fitted = fit_effect(
            type(effect), ws, rest, (), ws.states(ws.predict(rest)), start=effect, polish=False
        )
        if fitted is not None and not fitted.effect.is_null:
            model = rest.with_effect(fitted.effect, fitted.own)
    return ws.levelled(model)


def drop_idle(
    ws: Workspace, model: Model, choices: Sequence[Choice], rng: np.random.Generator
) -> tuple[Model, tuple[Choice, ...]]:
    """Drop effects without which the others, solved again, fit as well."""
    kept = list(choices)
    for choice in sorted(choices, key=lambda c: c.gain):
        if len(kept) < 2:
            break
        rest = refit_linear(ws, model.without(choice.name))
        full, less = ws.log_densities(model), ws.log_densities(rest)
        gain = ws.block_scores([a - b for a, b in zip(full, less, strict=True)])
        low, _ = bootstrap_interval(gain, rng)
        if low <= 0 or float(gain.sum()) < IDLE:
            model = rest
            kept.remove(choice)
    return model, tuple(kept)


def _prune(
    ws: Workspace, model: Model, choices: list[Choice], rng: np.random.Generator
) -> tuple[Model, list[Choice]]:
    """Refit together; drop effects without which the fit is as good."""
    if len(choices) < 2:
        return model, choices
    model = refit(ws, model)
    kept = list(choices)
    for choice in list(kept):
        if len(kept) < 2 or choice.name not in model.names():
            continue
        rest = refit_linear(ws, model.without(choice.name))
        full, less = ws.log_densities(model), ws.log_densities(rest)
        gain = ws.block_scores([a - b for a, b in zip(full, less, strict=True)])
        low, _ = bootstrap_interval(gain, rng)
        if low <= 0 or float(gain.sum()) < 4:
            model = rest
            kept.remove(choice)
    return model, kept
