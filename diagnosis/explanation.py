"""An explanation, in the making and as it stands: causes, their model, and where recordings lie."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.data.patch import Patch
from diagnosis.data.recorded import Recorded
from diagnosis.evidence.mean_causes import Member
from diagnosis.evidence.reported_causes import Cause, Unexplained
from diagnosis.evidence.seen import Seen
from diagnosis.fields import Field
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.physics.assumed_camera import assumed_sheets, seen_by
from diagnosis.physics.joint_fit import fit_laws
from diagnosis.physics.linear_fit import Fitted
from diagnosis.prepare import Prepared
from diagnosis.register.placement import Placement
from diagnosis.reregister.reregistration import log_density, reregistered
from diagnosis.settings import SETTINGS
from sensors.datasheet import Datasheet

Progress = Callable[[str], None]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Explanation:
    """What was found, and the patches at their placement under it.

    Attributes
    ----------
    causes : catalogued, strongest first
    unexplained : components that no catalogued effect claims
    first, members : the recordings as they were seen under the nominal model, and the mean's
        causes as they were weighed then
    before : baselines as they were seen then, where there are some
    usual : what good instruments have as well, with the probability that it is a fault
    scales, departures : what a good instrument has of each component, or changes by since its
        baselines, and what it shares with them
    refuted : effects whose laws do nothing beside no other: no cause of what was seen then
    """

    model: Model
    causes: tuple[Cause, ...]
    unexplained: tuple[Unexplained, ...]
    patches: tuple[Patch, ...]
    placed: Mapping[str, Placement]
    recorded: Recorded
    ws: Workspace
    first: Seen
    before: Seen | None
    members: tuple[Member, ...]
    scales: Mapping[str, Field]
    departures: Mapping[str, Field]
    usual: tuple[Unexplained, ...] = ()
    refuted: frozenset[str] = frozenset()

    @property
    def slips(self) -> set[str]:
        """Covariates of which profiles have multiples of their own, without a cause."""
        forms = (u.relaxed for u in self.unexplained if u.channel == "mean")
        return {f.times for f in forms if f is not None and f.times}

    @property
    def held(self) -> list[Patch]:
        """Patches with readings that nothing was fitted to."""
        return [p for p in self.patches if p.scored.any()]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Tried:
    """Laws at edges as they were fitted beside a model, on patches."""

    beside: Model
    patches: Sequence[Patch]
    laws: Mapping[str, Fitted]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class State:
    """How far the explanation has come.

    Attributes
    ----------
    first, now : recordings under the nominal model, and under the model
    before : baselines, in the components that recordings have now
    explained : whitened rms of what the laws explain
    gained : what laws of light at edges gain, nats
    refuted : effects whose laws, fitted, do nothing here: what goes with them is a remainder
    tried : laws at edges as they were last fitted, beside this model or the one before
    filtered : whether the recordings went through a filter that was found, a law before all others
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
    tried: Tried | None = None
    filtered: bool = False

    def fitted_here(self) -> Mapping[str, Fitted]:
        """Laws at edges that were fitted beside this model, on these patches."""
        if self.tried is None or self.tried.beside is not self.model:
            return {}
        return self.tried.laws if self.tried.patches is self.patches else {}

    @property
    def names(self) -> list[str]:
        """Names of the causes."""
        return [c.name for c in self.causes]


def fitted_part(patches: Sequence[Patch], noise: NoiseModel) -> Workspace:
    """Return a workspace of the patches that may be fitted."""
    return Workspace.build([p for p in patches if p.fit.any()], noise)


def under(model: Model, explanation: Explanation, ready: Prepared) -> Explanation:
    """Put another model in place of an explanation's; recordings are placed under it."""
    seen = seen_by(ready.patches, explanation.recorded.datasheet)
    patches, placed = reregistered(
        model, seen, explanation.recorded, ready.placed, ready.noise
    )
    return replace(
        explanation, model=model, patches=tuple(patches), placed=placed,
        ws=fitted_part(patches, ready.noise),
    )  # fmt: skip


def completed(
    recorded: Recorded,
    patches: Sequence[Patch],
    causes: Sequence[Cause],
    noise: NoiseModel,
    model: Model,
    notes: list[str],
) -> tuple[Recorded, Sequence[Patch]]:
    """Complete the sensor's file where a named cause's law needs what it leaves out.

    Each completion is tried with the new laws at the points of their grids; the one under which the
    readings are most probable stands. What was found before needed none of it. Where nothing tells
    a camera's sides apart, neither is assumed.
    """
    given = recorded.datasheet
    sheets = assumed_sheets(given, causes)
    if len(sheets) == 1:
        return recorded, patches

    def density(sheet: Datasheet) -> float:
        ws = fitted_part(seen_by(patches, sheet), noise).thin(SETTINGS.fitted_readings)
        trial, _ = fit_laws(causes, ws, model, polish=False)
        return log_density(ws.patches, noise, trial)

    densities = [density(sheet) for sheet in sheets]
    sheet = sheets[int(np.argmax(densities))]
    if given.triangulation_angle_deg is not None:
        if np.ptp(densities) < SETTINGS.stands_out:
            return recorded, patches
        notes.append(
            f"the sensor's file states no side of the camera: {sheet.camera_side} suits the "
            "readings best"
        )
    else:
        notes.append(
            "the sensor's file states no triangulation angle: of those tried, "
            f"{sheet.triangulation_angle_deg:g}° with the camera at {sheet.camera_side} suits the "
            "readings best"
        )
    return replace(recorded, datasheet=sheet), seen_by(patches, sheet)
