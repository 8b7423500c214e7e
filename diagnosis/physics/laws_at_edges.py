"""How much laws of light at edges do, by the laws themselves.

Where light lives on edges and in corners, depths depart by many times the noise, and a law's
columns at points of its grid tell little of what the law does. Each law is tried itself, at points
of its grid. The whitened rms of what it explains of N readings, the noise, and that at edges, as
large as suits with it and without, is

    r = (2 gain / N)^½,

with baselines beyond what the same law explains there. A good instrument has some of it: no law is
exactly nature's, and no edge is where a mesh has it. Of a size s, r is normal with the deviation s;
it is known but for a nat of chance, and for the share of other laws' signal that is in doubt.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from diagnosis.components.component import Component, laws_stated, stated
from diagnosis.discrepancy.population import LAW
from diagnosis.evidence.known_size import factors_of_value
from diagnosis.evidence.mean_causes import Scales
from diagnosis.evidence.reported_causes import Cause
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.physics.effect_fit import fit_effect
from diagnosis.physics.linear_fit import Fitted
from diagnosis.settings import SETTINGS
from sensors.datasheet import Datasheet
from sensors.effects import CATALOGUE

Floats = NDArray[np.float64]
NOMINAL = Model()


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class LawAtEdges:
    """One law as it was fitted at a point of its grid.

    Attributes
    ----------
    key : of the population's sizes
    gain : nats, less the numbers fitted
    gain_before : nats of the same in baselines
    size : whitened rms of what it explains
    factors : log Bayes factor of each size of the grid against none, (S,)
    fitted : None where it can't act
    """

    component: Component
    key: str
    gain: float
    gain_before: float
    size: float
    factors: Floats
    fitted: Fitted | None


def known_laws(components: Sequence[Component], sheet: Datasheet) -> list[Component]:
    """Pick the laws of light at edges that what a sensor's file states is enough for."""
    return [
        c for c in components
        if c.relaxed.spanned and c.effect
        and all(getattr(sheet, key) is not None for key in CATALOGUE[c.effect].needs)
    ]  # fmt: skip


def laws_in_turn(
    laws: Sequence[Component],
    ws: Workspace,
    model: Model,
    before: Workspace | None = None,
    *,
    explained: float = 0.0,
) -> list[LawAtEdges]:
    """Fit the law that explains most beside a model, and each other one beside that as well.

    They resemble each other: most of what another law explains alone, the strongest explains.

    Parameters
    ----------
    before : of baselines, which have none of the model's causes
    explained : whitened rms of what the model explains, of which a share is in doubt
    """
    few = ws.thin(SETTINGS.physics.tried_readings)
    before = before and before.thin(SETTINGS.physics.tried_readings)
    alone = laws_at_edges(laws, few, model, before, explained=explained)
    most = max(alone, key=lambda law: law.gain, default=None)
    if most is None or most.fitted is None or most.gain <= 0:
        return alone
    own = most.fitted.effect.shared()
    beside = few.levelled(model.with_effect(most.fitted.effect, most.fitted.own))
    there = NOMINAL
    if before is not None and most.gain_before > 0:
        there = before.levelled(there.with_effect(own))
    others = [law for law in laws if law is not most.component]
    return [most, *laws_at_edges(
        others, few, beside, before, there=there, explained=math.hypot(explained, most.size)
    )]  # fmt: skip


def laws_at_edges(
    laws: Sequence[Component],
    ws: Workspace,
    model: Model,
    before: Workspace | None = None,
    *,
    there: Model = NOMINAL,
    explained: float = 0.0,
) -> list[LawAtEdges]:
    """Fit laws beside a model, each alone.

    Parameters
    ----------
    before, there : baselines, and the model beside which the same law is tried in them
    explained : whitened rms of what the model explains, of which a share is in doubt
    """
    few = ws.thin(SETTINGS.physics.tried_readings)
    before = before and before.thin(SETTINGS.physics.tried_readings)
    states = few.states(few.predict(model))
    without, count = few.most_probable(model), max(few.count(), 1)
    usual = 0.0 if before is None else before.most_probable(there)
    unsure = math.hypot(1 / math.sqrt(count), SETTINGS.doubt * explained)
    listed = laws_stated(ws.patches[0].view.sensor.effects)
    out = []
    for law in laws:
        fitted = fit_effect(CATALOGUE[law.effect], few, model, states, polish=False)
        gain = square = same = 0.0
        if fitted is not None and not fitted.effect.is_null:
            whole = few.most_probable(model.with_effect(fitted.effect, fitted.own))
            gain = whole - without - fitted.free
            square = 2 * max(gain, 0.0) / count
            if before is not None:
                same = before.most_probable(there.with_effect(fitted.effect.shared())) - usual
                square -= 2 * max(same, 0.0) / max(before.count(), 1)
        size = math.sqrt(max(square, 0.0))
        out.append(LawAtEdges(
            component=law, key=key_of(law, listed=listed), gain=gain, gain_before=same, size=size,
            factors=factors_of_value(size, unsure, SETTINGS.mean_sizes()), fitted=fitted,
        ))  # fmt: skip
    return out


def factors_at_edges(
    components: Sequence[Component], ws: Workspace, before: Workspace | None = None
) -> dict[str, Floats]:
    """Log Bayes factors of each known law's sizes, by its key: the strongest, others beside it.

    Parameters
    ----------
    before : of baselines, beyond which a law is looked for
    """
    laws = known_laws(components, ws.patches[0].view.datasheet)
    return {law.key: law.factors for law in laws_in_turn(laws, ws, NOMINAL, before)}


def key_of(law: Component, *, listed: str) -> str:
    """Name under which the population holds what good instruments have of a law.

    Parameters
    ----------
    listed : how the sensor's file states laws at edges (`laws_stated`)
    """
    return stated(f"{LAW}: {law.effect}", listed)


def may_be_named(law: Component, usual: Mapping[str, Floats], *, listed: str) -> bool:
    """Whether any reading could make a law likelier than what a good instrument has of it.

    No Bayes factor of mixtures of the same sizes exceeds the largest ratio of their weights. Of a
    law that no good instrument was asked for nothing is known.
    """
    key = key_of(law, listed=listed)
    if key not in usual:
        return False
    scales = Scales(sizes=SETTINGS.mean_sizes(), weights=usual)
    most = float(np.log(scales.changed(key) / np.maximum(scales.of(key), 1e-300)).max())
    return SETTINGS.probability(most, law.effect) > SETTINGS.reported


def unusual_at_edges(laws: Sequence[LawAtEdges], usual: Mapping[str, Floats]) -> list[Cause]:
    """List as causes the laws of which good instruments likely have less, the least usual first.

    Parameters
    ----------
    usual : probability of each size in a good instrument
    """
    scales = Scales(sizes=SETTINGS.mean_sizes(), weights=usual)
    nats = {law.key: scales.nats(law.key, law.factors) for law in laws if law.gain > 0}
    found = []
    for law in sorted(laws, key=lambda law: -nats.get(law.key, -math.inf)):
        if law.key not in nats:
            continue
        probability = SETTINGS.probability(nats[law.key], law.component.effect)
        if probability > SETTINGS.reported:
            found.append(Cause(
                name=law.component.effect, channel="mean", probability=probability,
                alternatives=(), none_of_these=1 - probability, nats=nats[law.key], size=law.size,
                component=law.component,
            ))  # fmt: skip
    return found
