"""Explanation: causes by evidence, their laws, registration under them, unexplained components."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.claims.outliers_of_one_size import one_size_mm
from diagnosis.claims.plate_noise import levels_of_each
from diagnosis.components.component import Component
from diagnosis.data.patch import Patch
from diagnosis.data.recorded import Recorded
from diagnosis.discrepancy.good_instrument import (
    alike_at_edges,
    informed,
    kinds_of,
    mean_factors,
    rate_factors,
    rectified,
)
from diagnosis.discrepancy.population import Population
from diagnosis.evidence.assess import Assessment, assessed_mean, assessed_rates
from diagnosis.evidence.explained_rates import explained_shares
from diagnosis.evidence.mean_causes import Member
from diagnosis.evidence.noise_and_loss_baselines import beside_baselines
from diagnosis.evidence.noise_and_loss_channels import Channel
from diagnosis.evidence.noise_level import AGAINST_PLATES, steady_level
from diagnosis.evidence.reported_causes import Cause, Unexplained, not_yet_named, reported
from diagnosis.evidence.seen import Seen, channels_seen, seen
from diagnosis.fields import Field
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.physics.assumed_camera import assumed_sheets, seen_by
from diagnosis.physics.joint_fit import among_laws, fit_laws, refit, strongest_law
from diagnosis.physics.linear_fit import Fitted
from diagnosis.physics.remainder import curves_of, remainder
from diagnosis.prepare import Prepared
from diagnosis.register.placement import Placement
from diagnosis.reregister.reregistration import log_density, reregistered
from diagnosis.settings import SETTINGS
from sensors.effects import CATALOGUE
from sensors.view.covariates import COVARIATES

Progress = Callable[[str], None]
MOVED_WITH_PLACEMENT = {c.name for c in COVARIATES.values() if c.place}
"""Covariates of effects that are fitted again where the recordings lie then."""


TRAVEL_OFF = (
    "the sensor's way is longer, shorter or in another direction than the poses say: the placement "
    "of each recording takes that up"
)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Explanation:
    """What was found, and the patches at their placement under it.

    Attributes
    ----------
    causes : catalogued, strongest first
    unexplained : components that no catalogued effect claims
    first, members : the recordings as they were seen under the nominal model, and the mean's
        causes as they were weighed then
    scales : what a good instrument has of each component
    """

    model: Model
    causes: tuple[Cause, ...]
    unexplained: tuple[Unexplained, ...]
    patches: tuple[Patch, ...]
    placed: Mapping[str, Placement]
    recorded: Recorded
    ws: Workspace
    first: Seen
    members: tuple[Member, ...]
    scales: Mapping[str, Field]

    @property
    def held(self) -> list[Patch]:
        """Patches with readings that nothing was fitted to."""
        return [p for p in self.patches if p.scored.any()]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _State:
    """How far the explanation has come.

    Attributes
    ----------
    first, now : recordings under the nominal model, and under the model
    before : baselines, while the model is nominal
    explained : whitened rms of what the laws explain
    gained : what laws of light at edges gain, nats
    refuted : effects whose laws, fitted, do nothing here: what goes with them is a remainder
    """

    recorded: Recorded
    patches: Sequence[Patch]
    placed: Mapping[str, Placement]
    model: Model
    causes: tuple[Cause, ...]
    first: Seen
    now: Seen
    before: Seen | None
    explained: float = 0.0
    gained: float = 0.0
    refuted: frozenset[str] = frozenset()

    @property
    def names(self) -> list[str]:
        """Names of the causes."""
        return [c.name for c in self.causes]


def explain(
    ready: Prepared,
    population: Population,
    *,
    withheld: frozenset[str] = frozenset(),
    notes: list[str],
    progress: Progress,
) -> Explanation:
    """Find the causes of what departs, and fit their laws.

    Parameters
    ----------
    population : what good instruments have of each component
    withheld : names of effects that must not be considered
    """
    progress("weighing causes")
    noise, baseline = ready.noise, ready.baseline
    ws = fitted_part(ready.patches, noise)
    first = seen(ws.patches, noise, Model())
    before = seen(baseline, noise, Model(), like=first) if baseline else None
    baseline_channels = channels_seen(baseline, noise, Model(), first) if baseline else ()
    scales = _good(population, first, before, baseline_channels)
    if ready.nominal is not None and baseline:
        changes = levels_of_each(baseline, ready.nominal)
        scales |= steady_level(changes, scales[AGAINST_PLATES])
    if not baseline:
        scales = rectified(scales, ready.recorded.datasheet)
    state = _State(
        recorded=ready.recorded, patches=ready.patches, placed=ready.placed, model=Model(),
        causes=(), first=first, now=first, before=before,
    )  # fmt: skip
    members: tuple[Member, ...] = ()
    unexplained: list[Unexplained] = []
    for _ in range(SETTINGS.rounds):
        found = assessed_mean(
            state.now, scales, state.before, withheld=withheld, refuted=state.refuted,
            explained=state.explained,
        )  # fmt: skip
        if not members:
            members = found.mean
            if any(m.candidate.component.placement for m in members):
                notes.append(TRAVEL_OFF)
        named, unexplained = reported(found)
        further = _further(state, found, named, noise, notes, progress)
        if further is None:
            break
        state = further
    channels = _channels(state, noise, baseline_channels)
    of_rates = assessed_rates(channels, scales, withheld=withheld)
    named, nameless = reported(of_rates)
    new, alike = _by_chance(not_yet_named(named, state.names), state, noise)
    nameless = [*alike, *nameless]
    if new:
        state = _with_rates(state, new, noise, notes, progress)
        shares = explained_shares(of_rates.rates, _channels(state, noise, baseline_channels))
        state, strange = _explained(state, new, shares)
        nameless = [*strange, *nameless]
    return Explanation(
        model=state.model, causes=state.causes, unexplained=(*unexplained, *nameless),
        patches=tuple(state.patches), placed=state.placed, recorded=state.recorded,
        ws=fitted_part(state.patches, noise), first=first, members=members, scales=scales,
    )  # fmt: skip


def _further(
    state: _State,
    found: Assessment,
    named: Sequence[Cause],
    noise: NoiseModel,
    notes: list[str],
    progress: Progress,
) -> _State | None:
    """Explain what stands out most: a known law's remainder, or one more cause; None if nothing.

    One law at a time: what it leaves isn't what the others would have to explain.
    """
    new = not_yet_named(named, state.names)
    if len(new) > 1:
        new = [strongest_law(new, fitted_part(state.patches, noise), state.model)]
    rest = remainder(found, set(state.names) - curved(state.model))
    if rest is not None and all(rest.size >= c.size for c in new):
        curve = state.model.curve.beside(curves_of(rest, state.now, noise.sd_mm))
        causes = tuple(_beside_curve(c, rest) for c in state.causes)
        return _seen_again(state, replace(state.model, curve=curve), causes, noise)
    if not new:
        return None
    explained = float(np.sqrt(state.explained**2 + sum(m.size**2 for m in found.mean)))
    progress(f"fitting {new[0].name}")
    recorded, patches = _complete(
        state.recorded, state.patches, new, noise, state.model, notes
    )
    state = replace(state, recorded=recorded, patches=patches)
    gain, known = 0.0, dict[str, Fitted]()
    ws = fitted_part(patches, noise)
    if _is_law(new[0]):
        laws = _laws_of(state, found)
        spans = _gains_of_spans(found)
        named_by_law, gain, known = among_laws(new[0], laws, spans, ws, state.model)
        if state.gained > 0 and gain <= SETTINGS.doubt_of_laws * state.gained:
            # no more than what a law at edges leaves where its formula is another
            return replace(state, refuted=state.refuted | {new[0].name, *(c.effect for c in laws)})
        new = [named_by_law]
    model, new = fit_laws(new, ws, state.model, known=known)
    without = replace(state, refuted=state.refuted | {new[0].name})
    if _is_law(new[0]) and (new[0].doubt or new[0].name not in model.names()):
        # what was weighed is the law itself at points of its grid: fitted, it does next to nothing
        return without
    if state.causes:
        model, new = _without_remainders(state.model, model, new, notes)
        if not new:
            return without
    again = _seen_again(state, model, (*state.causes, *new), noise)
    return replace(again, explained=explained, gained=state.gained + gain)


def _gains_of_spans(found: Assessment) -> dict[str, float]:
    """What the span of each law's grid gains in the place of one that stands out, nats."""
    out: dict[str, float] = {}
    for member in (m for m in found.mean if m.candidate.component.relaxed.spanned):
        for name, gain in member.gains.items():
            effect = found.effects["mean"].get(name, "")
            out[effect] = max(gain, out.get(effect, 0.0))
    return out


def _laws_of(state: _State, found: Assessment) -> list[Component]:
    """Components of laws at edges that may be named yet, by what the sensor's file states."""
    sheet = state.recorded.datasheet
    free = {*found.effects["mean"].values()} - {*state.names, *state.refuted, ""}
    return [
        c for c in state.now.components
        if c.relaxed.spanned and c.effect in free
        and all(getattr(sheet, key) is not None for key in CATALOGUE[c.effect].needs)
    ]  # fmt: skip


def _seen_again(
    state: _State, model: Model, causes: tuple[Cause, ...], noise: NoiseModel
) -> _State:
    """Place the recordings under a model and look at them again."""
    patches, placed = reregistered(model, state.patches, state.recorded, state.placed, noise)
    ws = fitted_part(patches, noise)
    if _needs_refit(model):
        model = refit(ws.thin(SETTINGS.fitted_readings), model)
    # baselines were seen under the nominal model: beside a law they say nothing more
    return replace(
        state, patches=patches, placed=placed, model=model, causes=causes,
        now=seen(ws.patches, noise, model), before=None,
    )  # fmt: skip


def _with_rates(
    state: _State,
    new: Sequence[Cause],
    noise: NoiseModel,
    notes: list[str],
    progress: Progress,
) -> _State:
    """Fit the laws of causes of noise, losses and outliers, all together."""
    progress(f"fitting {', '.join(c.name for c in new)}")
    recorded, patches = _complete(
        state.recorded, state.patches, new, noise, state.model, notes
    )
    model, fitted = fit_laws(new, fitted_part(patches, noise), state.model)
    return replace(
        state, recorded=recorded, patches=patches, model=model, causes=(*state.causes, *fitted)
    )


def _channels(
    state: _State, noise: NoiseModel, baseline_channels: Sequence[Channel]
) -> Sequence[Channel]:
    """Look at noise, losses and outliers under the model, beside what baselines have of them."""
    patches = fitted_part(state.patches, noise).patches
    channels = channels_seen(patches, noise, state.model, state.first)
    return beside_baselines(channels, baseline_channels) if baseline_channels else channels


def _by_chance(
    new: Sequence[Cause], state: _State, noise: NoiseModel
) -> tuple[Sequence[Cause], list[Unexplained]]:
    """Take the names of outliers back that all lie equally far off: no chance makes such."""
    outliers = [c for c in new if c.channel == "outliers"]
    off = one_size_mm(fitted_part(state.patches, noise), state.model) if outliers else None
    if off is None:
        return new, []
    what = f"outliers that all lie {1e3 * off:+.0f} µm off"
    alike = [replace(c.unnamed(), component=what) for c in outliers]
    return [c for c in new if c not in outliers], alike


def _explained(
    state: _State, new: Sequence[Cause], shares: Mapping[tuple[str, str], float]
) -> tuple[_State, list[Unexplained]]:
    """Take the names back whose laws explain little of what they were named by.

    Parameters
    ----------
    shares : by channel and name, what the laws explain of the gain of their components
    """
    strange = [
        c for c in new if shares.get((c.channel, c.name), 1.0) < SETTINGS.explained_share
    ]
    names = {c.name for c in strange}
    model = state.model
    for name in names:
        model = model.without(name)
    causes = tuple(c for c in state.causes if c.name not in names)
    return replace(state, model=model, causes=causes), [c.unnamed() for c in strange]


def _good(
    population: Population, first: Seen, before: Seen | None, baseline_channels: Sequence[Channel]
) -> dict[str, Field]:
    """Probability of each component's sizes in this instrument when it is good.

    Parameters
    ----------
    before, baseline_channels : the mean and the channels of baselines, where there are some
    """
    if before is None:
        return population.of_kinds(kinds_of(population, mean_factors(first), good=False))
    factors = mean_factors(before)
    own = informed(population, factors, rate_factors(baseline_channels))
    return alike_at_edges(own, factors, before.candidates)


def _is_law(cause: Cause) -> bool:
    """Whether a cause was weighed by its law, and not by a free curve."""
    return cause.component is not None and cause.component.relaxed.spanned


def curved(model: Model) -> set[str]:
    """Return the causes beside whose laws there is a curve."""
    return {p.component.effect for p in model.curve.parts}


def _beside_curve(cause: Cause, rest: Member) -> Cause:
    """Say of a cause that its law leaves a remainder."""
    if cause.name != rest.candidate.effect:
        return cause
    return cause.doubted(
        f"Its law leaves a curve of {rest.size:.2g} of the noise (rms), which is kept beside it: "
        "the formula may be another."
    )


def _without_remainders(
    before: Model, model: Model, new: Sequence[Cause], notes: list[str]
) -> tuple[Model, list[Cause]]:
    """Drop later causes whose laws explain next to nothing: what others leave isn't their doing."""
    kept = [c for c in new if not c.doubt]
    for cause in new:
        if cause.doubt:
            notes.append(
                f"what the laws found leave goes with what {cause.name} follows, but its law "
                "explains none of it: taken for a remainder"
            )
            if cause.name not in before.names():
                model = model.without(cause.name)
    return model, kept


def fitted_part(patches: Sequence[Patch], noise: NoiseModel) -> Workspace:
    """Return a workspace of the patches that may be fitted."""
    return Workspace.build([p for p in patches if p.fit.any()], noise)


def _needs_refit(model: Model) -> bool:
    return any(e.covariate in MOVED_WITH_PLACEMENT for e in model.effects)


def _complete(
    recorded: Recorded,
    patches: Sequence[Patch],
    causes: Sequence[Cause],
    noise: NoiseModel,
    model: Model,
    notes: list[str],
) -> tuple[Recorded, Sequence[Patch]]:
    """Complete the sensor's file where a named cause's law needs what it leaves out.

    Each completion is tried with the new laws at the points of their grids; the one under which the
    readings are most probable stands. What was found before needed none of it.
    """
    sheets = assumed_sheets(recorded.datasheet, causes)
    if len(sheets) == 1:
        return recorded, patches
    best = None
    for sheet in sheets:
        views = seen_by(patches, sheet)
        ws = fitted_part(views, noise).thin(SETTINGS.fitted_readings)
        trial, _ = fit_laws(causes, ws, model, polish=False)
        density = log_density(ws.patches, noise, trial)
        if best is None or density > best[0]:
            best = density, sheet, views
    assert best is not None
    _, sheet, views = best
    notes.append(
        "the sensor's file states no triangulation angle: of those tried, "
        f"{sheet.triangulation_angle_deg:g}° with the camera at {sheet.camera_side} suits the "
        "readings best"
    )
    return replace(recorded, datasheet=sheet), views
