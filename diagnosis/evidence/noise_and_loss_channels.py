"""Scale, missing and outlier channels: their responses, and the same candidates by relaxed form.

What lies at depth edges has a level of its own among the losses, and says nothing of what is
smooth, since there no law is exact; noise and outliers are looked at off edges.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, label, uniform_filter

from diagnosis.components.component import (
    Component,
    cell_of,
    components_of,
    missing_columns,
    plain_columns,
    seen_by_cameras,
    stated,
)
from diagnosis.components.smooth import Ranges
from diagnosis.components.whitened_columns import column_groups
from diagnosis.data.patch import Patch
from diagnosis.evidence.glm import Events, Owners, Responses, Squares
from diagnosis.fields import Mask
from diagnosis.model.log_density import Whitened
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.predict.prediction import Prediction
from diagnosis.settings import SETTINGS

Floats = NDArray[np.float64]
BLOCK, SURROUNDINGS = 5, 25
"""Readings a side of a block whose squares are summed, and of what it is compared with."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class RateVariant:
    """One form of a component: cells of readings, and its columns there.

    Attributes
    ----------
    owner, count : cell of each reading, and how many cells there are
    level : (count, j) columns of the level
    columns : (count, k) of the component, of unit rms together
    size : rms before
    """

    owner: Owners
    count: int
    level: Floats
    columns: Floats
    size: float = 1.0

    def change(self, coefficients: Floats) -> Floats:
        """Change of the predictor (N,) by coefficients (k,) of the columns of any size."""
        return np.asarray((self.columns @ (self.size * coefficients))[self.owner])


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class RateCandidate:
    """One component of a channel on the readings taken, in one form or several.

    Attributes
    ----------
    listed : whether the sensor's file lists the effect
    """

    component: Component
    variants: tuple[RateVariant, ...]
    listed: bool = False

    def unclaimed(self) -> "RateCandidate":
        """Return the same as unknown physics."""
        return replace(self, component=replace(self.component, effect=""))

    @property
    def key(self) -> str:
        """Name under which the population of good instruments holds it."""
        own = f"{self.component.relaxed.channel}: {self.name}"
        return stated(own, "listed" if self.listed else "")

    @property
    def name(self) -> str:
        """Name of the component."""
        return self.component.name


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Channel:
    """Responses of one channel, and its candidates.

    Attributes
    ----------
    level_sd : deviations of the level, off edges and at them
    picks : for each patch, which readings take part
    doubts : curves by which what baselines show may be off in the recordings; their coefficients
        have the standard deviation 1
    """

    name: str
    responses: Responses
    level_sd: Floats
    candidates: tuple[RateCandidate, ...]
    picks: tuple[Mask, ...]
    doubts: tuple[RateVariant, ...] = ()


def channel_of(
    name: str,
    patches: Sequence[Patch],
    predictions: Sequence[Prediction],
    states: Sequence[Whitened],
    ranges: Ranges,
    noise: NoiseModel,
) -> Channel | None:
    """Gather a channel's responses and candidates; None where there are too few readings."""
    picks, responses = _responses(name, patches, predictions, states, noise)
    if responses.seen.size < SETTINGS.least_readings:
        return None
    edge = np.concatenate([p.edge[k] for p, k in zip(patches, picks, strict=True)])
    made = (_candidate(c, patches, picks, edge, ranges) for c in components_of(name))
    return Channel(
        name=name, responses=responses, level_sd=level_sd_of(responses),
        candidates=tuple(c for c in made if c is not None), picks=tuple(picks),
    )  # fmt: skip


def level_sd_of(responses: Responses) -> Floats:
    """Deviation of the level, off edges and at them; the noise's own level is free."""
    if not isinstance(responses, Events):
        return np.ones(2)
    usual = float(responses.root.mean())
    return np.array([SETTINGS.level_sd_off * usual, SETTINGS.level_sd_edge])


def _responses(
    name: str,
    patches: Sequence[Patch],
    predictions: Sequence[Prediction],
    states: Sequence[Whitened],
    noise: NoiseModel,
) -> tuple[list[Mask], Responses]:
    picks, seen, usual, even = [], [], [], []
    loose = heads = 0
    for patch, law, state in zip(patches, predictions, states, strict=True):
        ambiguous = binary_dilation(patch.softness[1] > SETTINGS.ambiguous, iterations=1)
        near = patch.fit & patch.counted & law.seen & ~ambiguous
        if name == "scale":
            sharp = patch.softness[0] > SETTINGS.sharp * noise.sd_mm
            pick = near & state.used & ~patch.edge & ~sharp
            square = np.minimum(np.square(state.innovations), SETTINGS.clip**2)
            even.append(_block_sums(square, pick))
            value, number = square, np.ones(patch.shape)
        else:
            # at an edge a spot is on two levels, and what it mixes follows the edge's own course
            pick = near if name == "missing" else near & patch.observed & ~patch.edge
            event = pick & (~patch.observed if name == "missing" else ~state.used)
            number = law.p_missing if name == "missing" else law.p_outlier
            marks, _ = label(event, structure=np.ones((3, 3)))
            loose += int(event.sum())
            heads += int(marks.max(initial=0))
            value = event.astype(float)
        picks.append(pick)
        seen.append(value[pick])
        usual.append(np.asarray(number, dtype=np.float64)[pick])
    if name == "scale":
        # a Gaussian's square has variance 2; those of neighbours may go together
        sums = np.concatenate(even)
        dispersion = float(np.square(sums).mean()) / 2 if sums.size else 1.0
    else:
        dispersion = min(loose / max(heads, 1), SETTINGS.largest_clump)
    dispersion, events, expected = max(dispersion, 1.0), np.concatenate(seen), np.concatenate(usual)
    if name == "scale":
        return picks, Squares(seen=events, number=expected, dispersion=dispersion)
    low = expected < SETTINGS.noise.usual_share
    noise_share = _noise_share(events[low])
    return picks, Events(
        seen=events, usual=np.where(low, noise_share, expected), noise=noise_share,
        dispersion=dispersion,
    )  # fmt: skip


def _noise_share(events: Floats) -> float:
    """Share of events that passes for noise, or what there is where that is less.

    An instrument that loses fewer readings than most departs in nothing.
    """
    there = (float(events.sum()) + 0.5) / max(events.size, 1)
    return min(SETTINGS.noise.usual_share, there)


def _block_sums(square: Floats, pick: Mask) -> Floats:
    """Deviations of whole blocks' sums of squares from their surroundings', per root of reading."""
    inside = pick.astype(float)
    wide = np.maximum(uniform_filter(inside, SURROUNDINGS, mode="constant"), 1e-9)
    mean = uniform_filter(np.where(pick, square, 0.0), SURROUNDINGS, mode="constant") / wide
    relative = np.where(pick, square / np.maximum(mean, 1e-9) - 1, 0.0)
    n, m = (BLOCK * (k // BLOCK) for k in square.shape)
    shape = n // BLOCK, BLOCK, m // BLOCK, BLOCK
    sums = relative[:n, :m].reshape(shape).sum(axis=(1, 3))
    counts = inside[:n, :m].reshape(shape).sum(axis=(1, 3))
    whole = counts == BLOCK**2
    return np.asarray(sums[whole] / BLOCK)


def _candidate(
    component: Component,
    patches: Sequence[Patch],
    picks: Sequence[Mask],
    edge: Mask,
    ranges: Ranges,
) -> RateCandidate | None:
    relaxed = component.relaxed
    variants = []
    if relaxed.each:
        owner, count = _owners(relaxed.each, patches, picks)
        variants.append(_in_cells(owner, count, edge, np.eye(count)))
    elif relaxed.spanned:
        made = [missing_columns(component, p) for p in patches]
        for j in range(len(made[0])):
            lost = np.concatenate([m[j][k] for m, k in zip(made, picks, strict=True)]) > 0.5
            if lost.any():
                one = np.array([[0.0], [1.0]])
                variants.append(_in_cells(lost.astype(np.int64), 2, edge, one, at_edges=True))
    else:
        for views in seen_by_cameras(component, patches):
            smooth = _smooth(component, views, picks, edge, ranges)
            if smooth is not None:
                variants.append(smooth)
    if not variants:
        return None
    listed = any(e.name == component.effect for e in patches[0].view.sensor.effects)
    return RateCandidate(component=component, variants=tuple(variants), listed=listed)


def _smooth(
    component: Component,
    patches: Sequence[Patch],
    picks: Sequence[Mask],
    edge: Mask,
    ranges: Ranges,
) -> RateVariant | None:
    """Sum readings over cells of the covariates, with the component's columns there.

    A share's root has a level that is the curve's own: what is lost at a line's ends is lost beside
    the few that are lost anywhere, and a curve about its mean would have to be less than none
    elsewhere. The level of the noise is free.
    """
    made = [m for p in patches if (m := plain_columns(component, p, ranges)) is not None]
    if len(made) < len(patches):
        return None
    cells = [cell_of(component, p, ranges) for p in patches]
    owner = np.concatenate([c[k] for c, k in zip(cells, picks, strict=True)])
    count = int(owner.max(initial=0)) + 1
    number = np.maximum(np.bincount(owner, minlength=count), 1)
    columns = np.stack([
        np.bincount(owner, np.concatenate([
            np.broadcast_to(m[j], p.shape)[k]
            for m, p, k in zip(made, patches, picks, strict=True)
        ]), count) / number
        for j in range(len(made[0]))
    ], axis=1)
    size = np.sqrt((number[:, None] * np.square(columns)).sum() / number.sum())
    if size == 0:
        return None
    columns = columns / size
    if component.relaxed.channel != "scale" and component.relaxed.along:
        columns = np.column_stack([columns, np.ones(count)])
    return replace(_in_cells(owner, count, edge, columns), size=float(size))


def _in_cells(
    owner: Owners, count: int, edge: Mask, columns: Floats, *, at_edges: bool = False
) -> RateVariant:
    """Split each cell into what is at edges and what isn't.

    Parameters
    ----------
    at_edges : whether the component says what there is at edges, as a law of light does; what a
        smooth curve has there is beside an edge's own losses, and tells nothing
    """
    level = np.repeat(np.array([[1.0, 0.0], [1.0, 1.0]]), count, axis=0)
    return RateVariant(
        owner=owner + count * edge, count=2 * count, level=level,
        columns=np.concatenate([columns, columns if at_edges else np.zeros_like(columns)]),
    )  # fmt: skip


def _owners(
    each: str, patches: Sequence[Patch], picks: Sequence[Mask]
) -> tuple[Owners, int]:
    out, at = [], 0
    for patch, pick in zip(patches, picks, strict=True):
        n, m = patch.shape
        own = column_groups(m)[None] if each == "column" else at + np.arange(n)[:, None]
        at += n
        out.append(np.broadcast_to(own, (n, m))[pick])
    groups = int(column_groups(patches[0].shape[1])[-1]) + 1
    return np.concatenate(out), groups if each == "column" else at
