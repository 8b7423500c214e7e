"""Recordings under a model, as the evidence sees them: equations of the mean, and channels."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from diagnosis.components.component import Component, components_of, with_pitches
from diagnosis.components.covariate_ranges import ranges_of
from diagnosis.components.law_forms import law_forms
from diagnosis.data.patch import Patch
from diagnosis.evidence.candidates import Candidate, candidates_of
from diagnosis.evidence.gram import Gram, Turns, grams_of, joined, shared_only, turned, turns_of
from diagnosis.evidence.noise_and_loss_channels import Channel, channel_of
from diagnosis.evidence.posterior import World
from diagnosis.model.log_density import Whitened
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.predict.prediction import Prediction

Floats = NDArray[np.float64]
Laws = Mapping[str, tuple[Floats, ...]]
RATES = ("scale", "missing", "outliers")
COVARIATES = ("x", "depth", "travel", "slope_y", "incidence", "half_vector", "clock",
              "part_x", "part_y", "part_z")  # fmt: skip


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Seen:
    """The mean of recordings under a model, as equations.

    Attributes
    ----------
    bulk, whole : normal equations of the mean's components, off edges and over all readings
    turns : how their columns were combined
    candidates : of the mean
    ranges : of covariates
    laws : by component, its columns as the law of its cause combines them
    """

    bulk: Gram
    whole: Gram
    turns: Turns
    candidates: tuple[Candidate, ...]
    components: tuple[Component, ...]
    ranges: Mapping[str, tuple[float, float]]
    laws: Laws = field(default_factory=dict)

    def louder(self, power: float) -> "Seen":
        """Let the noise have so much more power: unit columns are as much larger, and alike."""
        return replace(
            self, bulk=self.bulk.louder(power), whole=self.whole.louder(power),
            turns={name: np.sqrt(power) * turn for name, turn in self.turns.items()},
        )  # fmt: skip


def seen(
    patches: Sequence[Patch],
    noise: NoiseModel,
    model: Model,
    *,
    like: Seen | None = None,
) -> Seen:
    """Look at the mean of recordings under a model.

    Parameters
    ----------
    like : recordings whose components are taken, for others of the same instrument
    """
    ws = Workspace.build(patches, noise)
    states = ws.states(ws.predict(model))
    ranges = ranges_of(patches, COVARIATES) if like is None else like.ranges
    if like is None:
        components = with_pitches(components_of("mean"), patches, states)
    else:
        components = like.components
    bulk, whole = grams_of(components, patches, states, ranges, noise)
    turns = turns_of(bulk, whole) if like is None else like.turns
    bulk, whole = turned(bulk, turns), turned(whole, turns)
    components = tuple(c for c in components if c.name in turns)
    if like is None:
        laws: Laws = {c.name: law_forms(c, patches, ranges) for c in components}
    else:
        laws = like.laws
    return Seen(
        bulk=bulk, whole=whole, turns=turns, candidates=_candidates(bulk, laws, patches),
        components=components, ranges=ranges, laws=laws,
    )  # fmt: skip


def together(looks: Sequence[Seen], patches: Sequence[Patch]) -> Seen:
    """Take the recordings of several looks as those of one.

    Parameters
    ----------
    looks : all in the components of the first
    patches : of all of them
    """
    bulk, whole = (
        reduce(joined, grams)
        for grams in ([one.bulk for one in looks], [one.whole for one in looks])
    )
    return replace(
        looks[0], bulk=bulk, whole=whole, candidates=_candidates(bulk, looks[0].laws, patches)
    )


def _candidates(bulk: Gram, laws: Laws, patches: Sequence[Patch]) -> tuple[Candidate, ...]:
    times: dict[int, list[Floats]] = {}
    ways: dict[int, list[Floats]] = {}
    for p in patches:
        times.setdefault(p.recording, []).append(p.view.time_s)
        ways.setdefault(p.recording, []).append(p.view.travel_mm)
    return tuple(candidates_of(
        bulk, {k: np.concatenate(v) for k, v in times.items()},
        {k: np.concatenate(v) for k, v in ways.items()}, patches[0].view.sensor.effects, laws,
    ))  # fmt: skip


def worlds_of(found: Seen, before: Seen | None) -> dict[bool, World]:
    """Equations off edges (False) and of all readings (True), beside those of baselines."""
    return {
        edges: World(
            found=now.equations, baseline=None if then is None else shared_only(then, now)
        )
        for edges, now, then in (
            (False, found.bulk, None if before is None else before.bulk),
            (True, found.whole, None if before is None else before.whole),
        )
    }


def channels_seen(
    patches: Sequence[Patch], noise: NoiseModel, model: Model, like: Seen
) -> dict[str, Channel]:
    """Look at the noise, the losses and the outliers, where there is something to see, by name."""
    whole = Whitening.under(model, Workspace.build(patches, noise))
    made = {name: channel_seen(name, whole, like) for name in RATES}
    return {name: channel for name, channel in made.items() if channel is not None}


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Whitening:
    """Readings whitened under a model, once for all channels."""

    ws: Workspace
    laws: Sequence[Prediction]
    states: Sequence[Whitened]

    @classmethod
    def under(cls, model: Model, ws: Workspace) -> "Whitening":
        """Predict and whiten the readings of a workspace."""
        laws = ws.predict(model)
        return cls(ws=ws, laws=laws, states=ws.states(laws))


def channel_seen(name: str, whole: Whitening, like: Seen) -> Channel | None:
    """Look at one of them; None where there is nothing to see.

    Parameters
    ----------
    like : whose ranges of covariates are taken
    """
    ws = whole.ws
    return channel_of(name, ws.patches, whole.laws, whole.states, like.ranges, ws.noise)
