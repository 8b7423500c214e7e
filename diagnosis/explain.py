"""Explanation: causes by evidence, their laws, registration under them, unexplained components."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.cause import Cause, Strange, reported, without_kin
from diagnosis.edges import BESIDE_EDGES, EDGE_COVARIATES
from diagnosis.evidence.assess import RATES, Seen, assessed, good_factors, informed, seen
from diagnosis.evidence.causes import Member
from diagnosis.noise import Field, NoiseModel
from diagnosis.patch import Patch
from diagnosis.physics import assumed_sheets, fit_laws, refit, seen_by
from diagnosis.recorded import Recorded
from diagnosis.registration import Placement
from diagnosis.reregistration import log_density, placed_anew
from diagnosis.settings import SETTINGS
from diagnosis.workspace import Model, Workspace

Progress = Callable[[str], None]
SETTLED = EDGE_COVARIATES | BESIDE_EDGES | {"wall_distance"}
"""Covariates of effects that are fitted again where the recordings lie then."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Explanation:
    """What was found, and the patches at their placement under it.

    Attributes
    ----------
    causes : catalogued, strongest first
    strange : components that no catalogued effect claims
    first, members : the recordings as they were seen under the nominal model, and the mean's
        causes as they were weighed then
    scales : what a good instrument has of each component
    """

    model: Model
    causes: tuple[Cause, ...]
    strange: tuple[Strange, ...]
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


def explain(
    patches: Sequence[Patch],
    noise: NoiseModel,
    recorded: Recorded,
    placed: Mapping[str, Placement],
    population: Mapping[str, Field],
    *,
    baseline: Sequence[Patch] = (),
    withheld: frozenset[str] = frozenset(),
    notes: list[str],
    progress: Progress,
) -> Explanation:
    """Find the causes of what departs, and fit their laws.

    Parameters
    ----------
    placed : placements by name, from which patches are seen
    population : what good instruments have of each component
    baseline : patches of recordings of this instrument when it was good
    """
    progress("weighing causes")
    ws = fitted_part(patches, noise)
    first = now = seen(ws.patches, noise, Model())
    before = seen(baseline, noise, Model(), like=first) if baseline else None
    scales = population if before is None else informed(population, good_factors(before))
    model = Model()
    causes: list[Cause] = []
    strange: list[Strange] = []
    members: tuple[Member, ...] = ()
    explained = 0.0
    for _ in range(SETTINGS.rounds):
        found = assessed(now, scales, before, withheld=withheld, channels=("mean",),
                         explained=explained)  # fmt: skip
        members = members or found.mean
        named, strange = reported(found)
        # one law at a time: what it leaves isn't what the others would have to explain
        new = without_kin(named, [c.name for c in causes])[:1]
        if not new:
            break
        explained = float(np.sqrt(explained**2 + sum(m.size**2 for m in found.mean)))
        progress(f"fitting {', '.join(c.name for c in new)}")
        recorded, patches = _complete(recorded, patches, new, noise, model, notes)
        before_fit = model
        model, new = fit_laws(new, fitted_part(patches, noise), model)
        if causes:
            model, new = _without_remainders(before_fit, model, new, notes)
            if not new:
                break
        causes += new
        patches, placed = _settled(model, patches, placed, recorded, noise)
        ws = fitted_part(patches, noise)
        if _needs_refit(model):
            model = refit(ws.thin(SETTINGS.fitted_readings), model)
        # baselines were seen under the nominal model: beside a law they say nothing more
        now, before = seen(ws.patches, noise, model), None
    found = assessed(now, scales, withheld=withheld, channels=RATES)
    named, odd = reported(found)
    new = without_kin(named, [c.name for c in causes])
    if new:
        progress(f"fitting {', '.join(c.name for c in new)}")
        recorded, patches = _complete(recorded, patches, new, noise, model, notes)
        ws = fitted_part(patches, noise)
        model, new = fit_laws(new, ws, model)
        causes += new
    return Explanation(
        model=model, causes=tuple(causes), strange=(*strange, *odd), patches=tuple(patches),
        placed=placed, recorded=recorded, ws=ws, first=first, members=members,
        scales=scales,
    )  # fmt: skip


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
    return any(e.covariate in SETTLED for e in model.effects)


def _settled(
    model: Model,
    patches: Sequence[Patch],
    placed: Mapping[str, Placement],
    recorded: Recorded,
    noise: NoiseModel,
) -> tuple[Sequence[Patch], Mapping[str, Placement]]:
    """Place recordings anew under a model while that still moves them."""
    if not model.effects:
        return patches, placed
    for _ in range(SETTINGS.placed):
        before = patches
        patches, placed = placed_anew(model, patches, recorded, placed, noise, by_law=False)
        if all(a is b for a, b in zip(before, patches, strict=True)):
            break
    return patches, placed


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
