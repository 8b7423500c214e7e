"""One more law: of a cause that a free curve shows, or of light at edges."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.components.component import Component, laws_stated
from diagnosis.data.patch import Patch
from diagnosis.evidence.assess import Assessment
from diagnosis.evidence.mean_causes import Scales
from diagnosis.evidence.reported_causes import Cause, Unexplained
from diagnosis.evidence.seen import Seen, seen
from diagnosis.evidence.usual_share import usual_share
from diagnosis.explanation import Progress, State, Tried, completed, fitted_part
from diagnosis.fields import Field
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.physics.assumed_camera import seen_by
from diagnosis.physics.joint_fit import among_laws, fit_laws, refit
from diagnosis.physics.laws_at_edges import (
    known_laws,
    laws_in_turn,
    may_be_named,
    unusual_at_edges,
)
from diagnosis.reregister.reregistration import reregistered
from diagnosis.settings import SETTINGS
from sensors.datasheet import Datasheet
from sensors.view.covariates import COVARIATES

MOVED_WITH_PLACEMENT = {c.name for c in COVARIATES.values() if c.place}
"""Covariates of effects that are fitted again where the recordings lie then."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Good:
    """What an instrument in good order has.

    Attributes
    ----------
    scales : probability of each component's sizes; of each change beside baselines
    departures : of what it departs from the nominal model by
    baseline : its recordings, where there are some
    """

    noise: NoiseModel
    scales: Mapping[str, Field]
    departures: Mapping[str, Field]
    baseline: Sequence[Patch]

    def seen_by(self, sheet: Datasheet) -> Workspace | None:
        """Look at its recordings with another sensor's file; None where there are none."""
        if not self.baseline:
            return None
        return Workspace.build(seen_by(self.baseline, sheet), self.noise)

    def seen_like(self, now: Seen, sheet: Datasheet) -> Seen | None:
        """Look at the mean of its recordings, in the components of others; None of none."""
        if not self.baseline:
            return None
        return seen(seen_by(self.baseline, sheet), self.noise, Model(), like=now)


def by_law(
    state: State,
    found: Assessment,
    cause: Cause,
    good: Good,
    notes: list[str],
    progress: Progress,
) -> State:
    """Fit the law of a cause that was weighed by a free curve, and look again."""
    progress(f"fitting {cause.name}")
    cause = _with_usual_share(cause, state.now, found, good)
    completing = _completed(state, cause, good.noise, notes)
    ws = fitted_part(completing.patches, good.noise)
    model, (fitted,) = fit_laws([cause], ws, state.model)
    if (state.causes or state.filtered) and fitted.doubt:
        notes.append(
            f"what the laws found leave goes with what {cause.name} follows, but its law "
            "explains none of it: taken for a remainder"
        )
        return replace(completing, refuted=state.refuted | {cause.name})
    return _explained_by(completing, found, model, fitted, good)


def _with_usual_share(cause: Cause, now: Seen, found: Assessment, good: Good) -> Cause:
    """Say how unsure the strength of a cause's law is by what good instruments have."""
    departures = Scales(sizes=SETTINGS.mean_sizes(), weights=good.departures)
    own = next((m for m in found.mean if m.candidate.effect == cause.name), None)
    if own is None:
        return cause
    unsure = usual_share(own, now.bulk.matrix, now.candidates, departures)
    return replace(cause, unsure=unsure)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class AtEdges:
    """Laws of light at edges, each weighed by itself.

    Attributes
    ----------
    laws : that may be named yet
    unusual : those of which good instruments have less, as causes, the least usual first
    usual : names of those of which they have as much; what the strongest explains, each that
        resembles it may, where the strongest is more than usual
    habits : what good instruments have as well
    """

    laws: Sequence[Component]
    unusual: Sequence[Cause] = ()
    usual: Collection[str] = ()
    habits: Sequence[Unexplained] = ()


def weighed_at_edges(
    state: State, found: Assessment, good: Good, progress: Progress
) -> AtEdges:
    """Weigh each law at edges by its own size, where one could tell that it is a cause.

    The law that explains most is in the model while the others are weighed: they resemble it.
    """
    laws = _laws_of(state, found)
    nameable = _nameable(laws, state, good)
    if not nameable:
        return AtEdges(laws=laws)
    progress("trying laws at edges")
    ws = fitted_part(state.patches, good.noise)
    before = good.seen_by(state.recorded.datasheet)
    tried = laws_in_turn(laws, ws, state.model, before, explained=state.explained)
    own = [law for law in tried if law.component in nameable]
    unusual, habits = unusual_at_edges(own, good.scales)
    names = {c.name for c in unusual}
    strongest = tried[0].component.effect in names
    usual = set() if strongest else {law.effect for law in nameable} - names
    return AtEdges(laws=laws, unusual=unusual, usual=usual, habits=habits)


def by_law_at_edges(
    state: State,
    found: Assessment,
    at_edges: AtEdges,
    cause: Cause | None,
    good: Good,
    notes: list[str],
) -> State | None:
    """Explain what stands out at edges by one law, and look again; None where nothing does.

    Of the laws that good instruments have less of, the one that explains most; of those whose size
    can't tell, it as well. One that columns show off edges was weighed where good instruments
    have little of any: each of them may be in its place. What one leaves resembles the others: no
    second one is asked for that columns at points of the grids don't show.

    Parameters
    ----------
    cause : as such columns show it; None where they show none
    """
    laws, unusual, usual = at_edges.laws, at_edges.unusual, {*at_edges.usual}
    if cause is not None and cause.off_edges:
        usual = set()
    itself = {c.name: c.probability for c in unusual}
    everything = state.refuted | {law.effect for law in laws}
    if cause is None or cause.name in usual:
        if not unusual:  # good instruments do as much of it at edges, and of what resembles it
            return None if cause is None else replace(state, refuted=everything)
        cause = unusual[0]
    state = _completed(state, cause, good.noise, notes)
    ws = fitted_part(state.patches, good.noise)
    asked = cause
    cause, gain, known = among_laws(
        asked, [law for law in laws if law.effect not in usual], ws, state.model,
        known=state.fitted_here(),
    )  # fmt: skip
    cause = replace(cause, off_edges=asked.off_edges and cause.name == asked.name)
    state = replace(state, tried=Tried(beside=state.model, patches=state.patches, laws=known))
    if state.gained > 0 and gain <= SETTINGS.doubt_of_laws * state.gained:
        # no more than what a law at edges leaves where its formula is another
        return replace(state, refuted=everything | {cause.name})
    if not cause.off_edges:
        cause = cause.at_most(itself.get(cause.name, 1.0))
    model, (fitted,) = fit_laws([cause], ws, state.model, known=known)
    if fitted.doubt or cause.name not in model.names():
        # what was weighed is the law itself at points of its grid: fitted, it does next to nothing,
        # and of those beside it none does more
        refuted = (everything if gain > 0 else state.refuted) | {cause.name}
        return replace(state, refuted=refuted)
    again = _explained_by(state, found, model, fitted, good)
    return replace(again, gained=state.gained + gain)


def _nameable(laws: Sequence[Component], state: State, good: Good) -> list[Component]:
    """Pick the laws at edges whose own size could tell that they are no good instrument's."""
    listed = laws_stated(state.patches[0].view.sensor.effects)
    return [c for c in laws if may_be_named(c, good.scales, listed=listed)]


def _completed(state: State, cause: Cause, noise: NoiseModel, notes: list[str]) -> State:
    """Complete the sensor's file where a law needs what it leaves out."""
    recorded, patches = completed(
        state.recorded, state.patches, [cause], noise, state.model, notes
    )
    return replace(state, recorded=recorded, patches=patches)


def _explained_by(
    state: State, found: Assessment, model: Model, new: Cause, good: Good
) -> State:
    """Take a model with a new cause for true and look again."""
    explained = float(np.sqrt(state.explained**2 + sum(m.size**2 for m in found.mean)))
    again = seen_again(state, model, (*state.causes, new), good)
    return replace(again, explained=explained)


def _laws_of(state: State, found: Assessment) -> list[Component]:
    """Components of laws at edges that may be named yet, by what the sensor's file states."""
    free = {*found.effects["mean"].values()} - {*state.names, *state.refuted, ""}
    known = known_laws(state.now.components, state.recorded.datasheet)
    return [c for c in known if c.effect in free]


def seen_again(state: State, model: Model, causes: tuple[Cause, ...], good: Good) -> State:
    """Place the recordings under a model and look at them again.

    What their laws leave is held against the same baselines: these have none of the causes.
    """
    noise = good.noise
    patches, placed = reregistered(model, state.patches, state.recorded, state.placed, noise)
    ws = fitted_part(patches, noise)
    if _needs_refit(model):
        model = refit(ws.thin(SETTINGS.fitted_readings), model)
    now = seen(ws.patches, noise, model)
    return replace(
        state, patches=patches, placed=placed, model=model, causes=causes, now=now,
        before=good.seen_like(now, state.recorded.datasheet),
    )  # fmt: skip


def is_law(cause: Cause) -> bool:
    """Whether a cause was weighed by its law, and not by a free curve."""
    return cause.component is not None and cause.component.relaxed.spanned


def _needs_refit(model: Model) -> bool:
    return any(e.covariate in MOVED_WITH_PLACEMENT for e in model.effects)
