"""How much laws of light at edges do, by the laws themselves.

Where light lives on edges and in corners, depths depart by many times the noise, and a law's
columns at points of its grid tell little of what the law does. Each law is tried itself, at points
of its grid. The whitened rms of what it explains of N readings, the noise, and that at edges, as
large as suits with it and without, is

    r = (2 gain / N)^½,

A good instrument has some of it: no law is exactly nature's, and no edge is where a mesh has it. Of
a size s, r is normal with the deviation s; it is known but for a nat of chance, and for the share
of other laws' signal that is in doubt.

Beside baselines the gain is that over the same law as the baselines show it: a law that isn't
nature's finds another strength in the same light from one recording to the next.
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
from diagnosis.evidence.reported_causes import Cause, Unexplained
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.physics.assumed_camera import from_either_side
from diagnosis.physics.effect_fit import fit_effect
from diagnosis.physics.linear_fit import Fitted
from diagnosis.settings import SETTINGS
from sensors.datasheet import Datasheet
from sensors.effects import CATALOGUE
from sensors.effects.base import Effect

Floats = NDArray[np.float64]
NOMINAL = Model()


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class LawAtEdges:
    """One law as it was fitted at a point of its grid.

    Attributes
    ----------
    key : of the population's sizes
    gain : nats, less the numbers fitted; 0 where it can't act
    size : whitened rms of what it explains; beside baselines, of what it changed by
    factors : log Bayes factor of each size of the grid against none, (S,)
    all_factors : the same of all that it explains, whatever baselines show
    fitted : None where it gains nothing
    before : the same in baselines, where it is asked for
    """

    component: Component
    key: str
    gain: float
    size: float
    factors: Floats
    all_factors: Floats
    fitted: Fitted | None
    before: Fitted | None = None


class _Tried:
    """Readings beside whose model laws are tried.

    Parameters
    ----------
    readings, model : of recordings, or of baselines
    """

    def __init__(self, readings: Workspace, model: Model) -> None:
        self.ws = readings.thin(SETTINGS.physics.tried_readings)
        self.model = model
        self.count = max(self.ws.count(), 1)
        self.listed = laws_stated(readings.patches[0].view.sensor.effects)
        self._states = self.ws.states(self.ws.predict(model))
        self._without = self.ws.most_probable(model)

    def fit(self, law: Component) -> tuple[Fitted | None, float]:
        """Fit a law at points of its grid; also its gain in nats, less the numbers fitted.

        None where it can't act, or gains nothing.
        """
        fitted = fit_effect(
            CATALOGUE[law.effect], self.ws, self.model, self._states, polish=False, at_edges=True
        )
        if fitted is None or fitted.effect.is_null:
            return None, 0.0
        gain = self.gain(fitted.effect, fitted.own) - fitted.free
        return (fitted, gain) if gain > 0 else (None, 0.0)

    def gain(self, effect: Effect, own: Mapping[int, Mapping[str, float]] | None = None) -> float:
        """Nats that an effect explains."""
        return self.ws.most_probable(self.model.with_effect(effect, own)) - self._without

    def gain_of_usual(self, before: Fitted | None) -> float:
        """Nats that the law explains as baselines show it; 0 where they don't."""
        return 0.0 if before is None else max(self.gain(before.effect.shared()), 0.0)

    def size_of(self, gain: float, explained: float) -> tuple[float, Floats]:
        """Whitened rms of what gains so much, and the log factors of sizes that say so.

        Parameters
        ----------
        explained : whitened rms of what the model explains, of which a share is in doubt
        """
        size = math.sqrt(2 * max(gain, 0.0) / self.count)
        unsure = math.hypot(1 / math.sqrt(self.count), SETTINGS.doubt * explained)
        return size, factors_of_value(size, unsure, SETTINGS.mean_sizes())

    def with_law(self, fitted: Fitted) -> "_Tried":
        """Have a law in the model."""
        return _Tried(self.ws, self.ws.levelled(self.model.with_effect(fitted.effect, fitted.own)))


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

    They resemble each other: most of what another law explains alone, the strongest explains. One
    that explains nothing alone has nothing left to explain. A camera whose side the sensor's file
    doesn't state is where the strongest law explains more.

    Parameters
    ----------
    before : of baselines, which have none of the model's causes
    explained : whitened rms of what the model explains, of which a share is in doubt
    """
    sides = from_either_side(ws)
    baselines = [None] * len(sides) if before is None else from_either_side(before)
    tried = [
        _in_turn(
            laws, _Tried(now, model), None if then is None else _Tried(then, NOMINAL), explained
        )
        for now, then in zip(sides, baselines, strict=True)
    ]
    return max(tried, key=lambda own: max((law.gain for law in own), default=0.0))


def _in_turn(
    laws: Sequence[Component], now: _Tried, then: _Tried | None, explained: float
) -> list[LawAtEdges]:
    alone = [_law_at_edges(law, now, then, explained) for law in laws]
    most = max(alone, key=lambda law: law.gain, default=None)
    if most is None or most.fitted is None:
        return alone
    beside = now.with_law(most.fitted)
    there = then.with_law(most.before) if then and most.before else then
    explained = math.hypot(explained, most.size)
    others = (law for law in alone if law is not most)
    return [most, *(
        law if law.fitted is None else _law_at_edges(law.component, beside, there, explained)
        for law in others
    )]  # fmt: skip


def _law_at_edges(
    law: Component, now: _Tried, before: _Tried | None, explained: float
) -> LawAtEdges:
    """Fit one law, and weigh what it explains, or what it changed by."""
    fitted, gain = now.fit(law)
    then, _ = (None, 0.0) if before is None or fitted is None else before.fit(law)
    (_, every), (size, factors) = (
        now.size_of(nats, explained) for nats in (gain, gain - now.gain_of_usual(then))
    )
    return LawAtEdges(
        component=law, key=key_of(law, listed=now.listed), gain=gain, size=size, factors=factors,
        all_factors=every, fitted=fitted, before=then,
    )  # fmt: skip


def nats_of_law(
    law: Component,
    effect: Effect,
    ws: Workspace,
    model: Model,
    before: Workspace | None,
    usual: Mapping[str, Floats],
    *,
    explained: float,
) -> float | None:
    """Log Bayes factor of a law as it is, against what a good instrument has of it.

    Readings that it wasn't fitted to may be among those that it is weighed on: what it loses there
    makes its size smaller. One that gains beside other causes no more than its own numbers cost is
    none, whatever was seen before those were found. None where no size could tell (`may_be_named`).

    Parameters
    ----------
    model : beside which the law is
    before, explained : as for `laws_in_turn`
    usual : as for `unusual_at_edges`
    """
    now = _Tried(ws, model)
    gain, key = now.gain(effect), key_of(law, listed=now.listed)
    if model.effects and gain <= len(effect.searched()):
        return -math.inf
    if not may_be_named(law, usual, listed=now.listed):
        return None
    then, _ = (None, 0.0) if before is None else _Tried(before, NOMINAL).fit(law)
    _, factors = now.size_of(gain - now.gain_of_usual(then), explained)
    return Scales(sizes=SETTINGS.mean_sizes(), weights=usual).nats(key, factors)


def shown_at_edges(
    components: Sequence[Component], ws: Workspace, before: Workspace | None = None
) -> list[LawAtEdges]:
    """Fit each known law under the nominal model: the strongest, others beside it.

    Parameters
    ----------
    before : of baselines, beyond which a law is looked for
    """
    laws = known_laws(components, ws.patches[0].view.datasheet)
    return laws_in_turn(laws, ws, NOMINAL, before)


def factors_at_edges(laws: Sequence[LawAtEdges]) -> dict[str, Floats]:
    """Log Bayes factors of each law's sizes, by its key."""
    return {law.key: law.factors for law in laws}


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


def unusual_at_edges(
    laws: Sequence[LawAtEdges], usual: Mapping[str, Floats]
) -> tuple[list[Cause], list[Unexplained]]:
    """List as causes the laws of which good instruments likely have less, the least usual first.

    Parameters
    ----------
    usual : probability of each size in a good instrument

    Returns
    -------
    causes; what good instruments have as well
    """
    scales = Scales(sizes=SETTINGS.mean_sizes(), weights=usual)
    nats = {law.key: scales.nats(law.key, law.factors) for law in laws if law.gain > 0}
    found: list[Cause] = []
    habits: list[Unexplained] = []
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
        else:
            habits.append(Unexplained(
                component=law.component.effect, channel="mean", probability=probability,
                nats=law.gain, size=law.size, relaxed=law.component.relaxed,
                effect=law.component.effect,
            ))  # fmt: skip
    return found, habits
