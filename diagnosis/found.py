"""The effects of a diagnosis as they are reported: what each gains, its intervals, its rivals."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from diagnosis.candidates import Candidates
from diagnosis.edges import on_edges
from diagnosis.heldout import Judgement, judge
from diagnosis.select import Choice, refit_linear
from diagnosis.shrinkage import shrunk_at_edges
from diagnosis.uncertainty import Estimate, intervals
from diagnosis.workspace import Model, Workspace
from sensors.datasheet import Datasheet, with_effects
from sensors.effects import effects_of
from sensors.effects.base import Effect
from sensors.model import as_wide
from sensors.view.covariates import COVARIATES


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class FoundEffect:
    """One effect of the diagnosis as it is reported."""

    name: str
    effect: Effect
    statement: str
    parameters: dict[str, Estimate]
    heldout_gain: float
    covariate: str
    covariate_key: str
    frame: str
    alternatives: tuple[tuple[str, float], ...]
    separating: str


def found_effects(
    ws: Workspace,
    model: Model,
    choices: Sequence[Choice],
    candidates: Candidates,
) -> tuple[tuple[FoundEffect, ...], Judgement]:
    """Estimate what each effect of the model gains on held-out readings, and judge the whole.

    Each model, with an effect or without, is judged where its own best placement is.
    """

    def judged(trial: Model) -> Judgement:
        placed = candidates.placed(shrunk_at_edges(ws, trial))
        return judge(placed.held, ws.noise, placed.model, share_own=candidates.share_own)

    gains, after = heldout_gains(ws, model, judged)
    chosen: dict[str, Choice] = {c.name: c for c in choices}
    bounds = intervals(ws, model)
    out = []
    for effect in model.effects:
        choice = chosen.get(effect.name)
        rivals = choice.alternatives if choice else ()
        covariate = COVARIATES[getattr(effect, "against", effect.covariate)]
        statement = effect.describe()
        if rivals:
            names = " or ".join(name for name, _ in rivals)
            statement += (
                f" These recordings can't tell it from {names}; to separate them: "
                f"{effect.separating}."
            )
        out.append(
            FoundEffect(
                name=effect.name,
                effect=effect,
                statement=statement,
                parameters=bounds.get(effect.name, {}),
                heldout_gain=gains[effect.name],
                covariate=covariate.words,
                covariate_key=covariate.name,
                frame=covariate.frame if effect.name == "empirical" else effect.frame,
                alternatives=tuple((n, g / max(ws.count(), 1)) for n, g in rivals),
                separating=effect.separating,
            )
        )
    return tuple(sorted(out, key=lambda f: -f.heldout_gain)), after


def heldout_gains(
    ws: Workspace, model: Model, judged: Callable[[Model], Judgement]
) -> tuple[dict[str, float], Judgement]:
    """Nats per held-out reading that the model loses without each effect; the whole, judged.

    Bulk physics counts by the readings that no depth edge reaches, as it was found.

    Parameters
    ----------
    judged : judges a model on the readings held out
    """
    after = judged(model)
    gains = {}
    for effect in model.effects:
        rest = model.without(effect.name)
        if len(rest.effects) > 1 or (rest.effects and rest.effects[0].name != "empirical"):
            rest = refit_linear(ws, rest)
        if "variance" in effect.channels:
            # the noise's level is free with it: that alone is no gain of the effect's
            rest = ws.levelled(rest, shaped=True)
        without = judged(rest)
        if on_edges(effect):
            gains[effect.name] = without.log_score - after.log_score
        else:
            gains[effect.name] = without.bulk_score - after.bulk_score
    return gains, after


def plainly_found(
    effect: Effect, gain: float, parameters: dict[str, Estimate]
) -> FoundEffect:
    """Report an effect that was measured by itself."""
    covariate = COVARIATES[effect.covariate]
    return FoundEffect(
        name=effect.name,
        effect=effect,
        statement=effect.describe(),
        parameters=parameters,
        heldout_gain=gain,
        covariate=covariate.words,
        covariate_key=covariate.name,
        frame=effect.frame,
        alternatives=(),
        separating=effect.separating,
    )


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
