"""The effects of a diagnosis as they are reported: what each gains, its intervals, its rivals."""

import math
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

from scipy.special import expit, logit

from diagnosis.evidence.reported_causes import Cause
from diagnosis.model.model import Model
from diagnosis.model.shrinkage import shrunk
from diagnosis.model.workspace import Workspace
from diagnosis.physics.joint_fit import refit_linear
from diagnosis.physics.uncertainty import Estimate, intervals
from diagnosis.predict.edges import reaches_edges
from diagnosis.settings import SETTINGS
from diagnosis.validate.heldout import Judgement, judge
from diagnosis.validate.placement_candidates import Candidates
from sensors.datasheet import Datasheet, with_effects
from sensors.effects import CATALOGUE, effects_of
from sensors.effects.base import Effect
from sensors.model import as_wide
from sensors.view.covariates import COVARIATES


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class FoundEffect:
    """One effect of the diagnosis as it is reported.

    Attributes
    ----------
    probability : that this cause is at work, the other reported ones given
    alternatives : (name, nats per fitted reading, probability) of other causes in its place
    none_of_these : probability that neither it nor an alternative is at work
    doubt : what speaks against its law, not against the cause
    law_stands : whether held-out readings leave its law more probable than not
    """

    name: str
    effect: Effect
    statement: str
    parameters: dict[str, Estimate]
    heldout_gain: float
    covariate: str
    covariate_key: str
    frame: str
    alternatives: tuple[tuple[str, float, float], ...]
    separating: str
    probability: float
    none_of_these: float
    doubt: str = ""
    law_stands: bool = True

    def times(self, share: float) -> "FoundEffect":
        """Return the effect where that share of the probability of all its names is left."""
        return replace(
            self, probability=share * self.probability,
            alternatives=tuple((n, nats, share * p) for n, nats, p in self.alternatives),
            none_of_these=1 - share * (1 - self.none_of_these),
        )  # fmt: skip


def found_effects(
    ws: Workspace,
    model: Model,
    causes: Sequence[Cause],
    candidates: Candidates,
) -> tuple[tuple[FoundEffect, ...], Judgement]:
    """Estimate what each effect of the model gains on held-out readings, and judge the whole.

    Each model, with an effect or without, is judged where its own best placement is.
    """

    def judged(trial: Model) -> Judgement:
        placed = candidates.placed(shrunk(ws, trial))
        return judge(placed.held, ws.noise, placed.model, share_own=candidates.share_own)

    gains, after = heldout_gains(ws, model, judged)
    chosen = {c.name: c for c in causes}
    bounds = intervals(ws, model, {c.name: c.unsure for c in causes})
    out = []
    for effect in model.effects:
        cause = chosen.get(effect.name)
        if cause is None:
            # the noise told of it, and its law is in the model for that
            sure = SETTINGS.probability(ws.count() * gains[effect.name], effect.name)
            cause = Cause(
                name=effect.name, channel=effect.channels[0], probability=sure, alternatives=(),
                none_of_these=1 - sure, nats=0.0,
            )  # fmt: skip
        weighed = _on_heldout(cause, gains[effect.name], _readings(effect, after))
        one = _found(
            effect, effect.describe(), bounds.get(effect.name, {}), gains[effect.name],
            replace(cause, doubt=weighed.doubt) if cause.shown_again else weighed, ws.count(),
        )  # fmt: skip
        out.append(replace(one, law_stands=1 - weighed.none_of_these > SETTINGS.reported))
    # recognised by what they follow, while their laws don't fit; the likeliest curve, drawn on past
    # the readings that it was fitted to, says less of these than all curves together did
    for cause in (c for c in causes if c.name not in model.names()):
        gain = gains.get(cause.name, 0.0)
        known = CATALOGUE[cause.name]
        weighed = cause if cause.on_all else _on_heldout(cause, gain, after.bulk)
        out.append(_found(known.none(), known.summary, {}, gain, weighed, ws.count()))
    return tuple(sorted(out, key=lambda f: -f.heldout_gain)), after


def _on_heldout(cause: Cause, gain: float, readings: int) -> Cause:
    """Weigh a cause on what readings held out say against its law; nothing was fitted to them.

    Parameters
    ----------
    gain : of the law, nats a reading
    """
    if gain >= 0:
        return cause
    odds = gain * readings - logit(max(cause.none_of_these, 1e-300))
    return cause.at_most(float(expit(odds))).doubted(
        "Its law doesn't improve the held-out readings."
    )


def _readings(effect: Effect, judgement: Judgement) -> int:
    """Count the readings that an effect is judged on: of bulk physics those off edges."""
    return int(judgement.counts.sum()) if reaches_edges(effect) else judgement.bulk


def _found(
    effect: Effect,
    statement: str,
    parameters: dict[str, Estimate],
    gain: float,
    cause: Cause,
    readings: int,
) -> FoundEffect:
    covariate = COVARIATES[getattr(effect, "against", effect.covariate)]
    if cause.alternatives:
        names = " or ".join(name for name, _ in cause.alternatives)
        statement += (
            f" These recordings can't tell it from {names}; to separate them: "
            f"{effect.separating}."
        )
    if cause.doubt:
        statement += f" {cause.doubt}"
    known = _log(cause.probability)
    return FoundEffect(
        name=effect.name, effect=effect, statement=statement, parameters=parameters,
        heldout_gain=gain, covariate=covariate.words, covariate_key=covariate.name,
        frame=effect.frame,
        alternatives=tuple(
            (n, max(cause.nats + _log(p) - known, 0.0) / max(readings, 1), p)
            for n, p in cause.alternatives
        ),
        separating=effect.separating, probability=cause.probability,
        none_of_these=cause.none_of_these, doubt=cause.doubt,
    )  # fmt: skip


def _log(probability: float) -> float:
    """Return its logarithm: what held-out readings speak against may be as rare as no number is."""
    return math.log(max(probability, sys.float_info.min))


def heldout_gains(
    ws: Workspace, model: Model, judged: Callable[[Model], Judgement]
) -> tuple[dict[str, float], Judgement]:
    """Nats per held-out reading that the model loses without each cause; the whole, judged.

    Bulk physics counts by the readings that no depth edge reaches, as it was found.

    Parameters
    ----------
    judged : judges a model on the readings held out
    """
    after = judged(model)
    gains = {}
    for effect in model.effects:
        rest = model.without(effect.name)
        if rest.effects:
            rest = refit_linear(ws, rest)
        if "variance" in effect.channels:
            # the noise's level is free with it: that alone is no gain of the effect's
            rest = ws.levelled(rest, shaped=True)
        without = judged(rest)
        if reaches_edges(effect):
            gains[effect.name] = without.log_score - after.log_score
        else:
            gains[effect.name] = without.bulk_score - after.bulk_score
    for name in {p.component.effect for p in model.curve.parts} - set(model.names()):
        gains[name] = judged(model.without(name)).bulk_score - after.bulk_score
    return gains, after


def plainly_found(
    effect: Effect,
    gain: float,
    parameters: dict[str, Estimate],
    *,
    probability: float,
    doubt: str = "",
) -> FoundEffect:
    """Report an effect that was measured by itself."""
    cause = Cause(
        name=effect.name, channel=effect.channels[0], probability=probability, alternatives=(),
        none_of_these=1 - probability, nats=0.0, doubt=doubt,
    )  # fmt: skip
    return _found(effect, effect.describe(), parameters, gain, cause, 1)


def at_limits(found: Iterable[FoundEffect]) -> list[str]:
    """Say which numbers lie where the catalogue ends: perhaps another law is at work."""
    notes = []
    for one in found:
        for name, estimate in one.parameters.items():
            value = estimate.value
            p = one.effect.parameter(name)
            if value in {p.low, p.high} - {0.0, p.null}:
                limit = f"{value:g} {p.unit}".strip()
                notes.append(
                    f"{one.name}: {name} is at the catalogue's limit, {limit}: perhaps another law "
                    "is at work"
                )
    return notes


def sheet_with(datasheet: Datasheet, effects: Sequence[Effect]) -> Datasheet:
    """Return the sensor's file with what was found, each in place of an entry of its name.

    A line that is wider for one effect is so for all that the file lists, as it was predicted.
    """
    listed, found = effects_of(datasheet), {e.name: e for e in effects}
    wide = as_wide(listed, found)
    new = {e.name: e for e, was in zip(wide, listed, strict=True) if e != was} | found
    return with_effects(datasheet, tuple(e.to_mapping() for e in new.values()))
