"""Explanation: selection, placing anew under what was chosen, and the word of held-out readings.

What gains nothing on held-out readings is no explanation: it is dropped with what was chosen after
it, and the selection goes on without that name.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from diagnosis.edges import BESIDE_EDGES, EDGE_COVARIATES, READ_AT_EDGES, on_edges
from diagnosis.found import heldout_gains
from diagnosis.heldout import judge
from diagnosis.linear import phase_is_own
from diagnosis.noise import Mask, NoiseModel
from diagnosis.patch import Patch
from diagnosis.prediction import predict
from diagnosis.recorded import Recorded
from diagnosis.registration import Placement
from diagnosis.reregistration import placed_anew
from diagnosis.screen import lists_edges
from diagnosis.select import (
    LEAST_GAIN,
    SEARCHED_READINGS,
    Progress,
    Selection,
    drop_idle,
    refit,
    refit_linear,
    screen,
    select,
)
from diagnosis.workspace import Model, Workspace
from sensors.effects.base import Effect
from sensors.effects.motion_blur import MotionBlur

LEAST_SHARE = 0.06
"""Share of the largest effect's gain below which another one mends what its law leaves."""
MUCH = 0.03
"""Nats per held-out reading that are more than a law leaves, however much it gains."""
LEAST_SHOWN = 0.05
"""Rms departure, in deviations, below which held-out readings can't speak of an effect."""
LEAST_UNSHOWN = 0.03
"""The same in the fitted recording that shows it most, below which its word isn't enough."""
NOISY = 0.9
"""Flicker beyond which a blur scatters about as much as it may."""
LEAST_NOISY = 0.06
"""Nats per held-out reading below which such a blur is of no use.

All that it says may be that edges are noisier than a coarse law has them: four of the sixteenth
sealed set that weren't there gained 0.02 to 0.05; the five true ones, whose flicker is 0.3 to 0.7,
0.08 and more.
"""
LEAST_BLUR = 0.03
"""The same for any blur where the sensor's file says what depth edges do: one that wasn't there
gained 0.025, and one 0.04 in place of what has no name.
"""
LEAST_LISTED = 0.01
"""The same for an effect on depth edges of which the sensor's file says what they do.

It may mend the maker's coarse law: of opened cases, four such effects that weren't there gained
less, and all true ones more.
"""
TRIALS = 4
PLACED = 3
"""Times that recordings are placed under a model at most, where that still moves them."""
TURNS = 2
"""Times that blurred recordings are placed by the law of the model, which is fitted again."""
LONG_BLUR = 2.0
"""Profiles during one exposure from which silhouettes alone don't tell a part of a pitch."""
SETTLED = EDGE_COVARIATES | BESIDE_EDGES | {"wall_distance"}
"""Covariates of effects that are fitted again where the recordings lie then."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Explanation:
    """What was chosen, and the patches at their placement under it."""

    selection: Selection
    patches: tuple[Patch, ...]
    placed: Mapping[str, Placement]
    ws: Workspace

    @property
    def model(self) -> Model:
        """The effects chosen."""
        return self.selection.model

    @property
    def held(self) -> list[Patch]:
        """Patches with readings that nothing was fitted to."""
        return [p for p in self.patches if p.scored.any()]


def shows(effect: Effect, patches: Sequence[Patch], noise: NoiseModel) -> bool:
    """Whether held-out readings can speak of an effect, or fitted ones show it no better.

    What fades with time may be over before the held-out recording begins, a slip along the
    travel moves nothing where that recording looks at flats, and an error of the range is a tilt
    and a shift where it sees planes that lie as one.
    """
    if effect.frame == "part" or on_edges(effect):
        return True
    waves = [effect]
    if phase_is_own(effect):
        waves = [effect.with_parameters(phase_rad=phase) for phase in (0.0, 0.5 * math.pi)]
    held, fitted = (
        max(left_by_placement(wave, patches, masks, noise) for wave in waves)
        for masks in ([p.scored for p in patches], [p.fit for p in patches])
    )
    return held > LEAST_SHOWN or fitted < max(LEAST_UNSHOWN, 2 * held)


def _least_of(effect: Effect, listed: bool) -> float:
    """Nats per held-out reading that an effect must gain, whatever the others do.

    Parameters
    ----------
    listed : whether the sensor's file says what depth edges do
    """
    if isinstance(effect, MotionBlur):
        if effect.flicker > NOISY:
            return LEAST_NOISY
        if listed:
            return LEAST_BLUR
    at_edges = effect.covariate in READ_AT_EDGES
    return LEAST_LISTED if listed and at_edges else LEAST_GAIN


def left_by_placement(
    effect: Effect, patches: Sequence[Patch], masks: Sequence[Mask], noise: NoiseModel
) -> float:
    """Rms of what an effect does to the mean beyond a placement, in units of the noise.

    In the recording where that is largest.
    """
    sums = {p.recording: np.zeros(2) for p in patches}
    for patch, mask in zip(patches, masks, strict=True):
        if not mask.any():
            continue
        plain, with_it = (predict(patch.view, e, noise) for e in ((), (effect,)))
        pick = mask & plain.seen & with_it.seen & ~patch.edge
        change = ((with_it.mean_mm - plain.mean_mm) / plain.sd_mm)[pick]
        columns = patch.columns[pick] / plain.sd_mm[pick][:, None]
        ridge = np.eye(columns.shape[1])
        left = change - columns @ np.linalg.solve(columns.T @ columns + ridge, columns.T @ change)
        sums[patch.recording] += float(left @ left), left.size
    return max(float(np.sqrt(squares / max(count, 1))) for squares, count in sums.values())


def explain(
    patches: Sequence[Patch],
    noise: NoiseModel,
    recorded: Recorded,
    placed: Mapping[str, Placement],
    rng: np.random.Generator,
    *,
    withheld: Iterable[str],
    share_own: bool,
    notes: list[str],
    progress: Progress,
) -> Explanation:
    """Choose effects that hold on held-out readings, too.

    Parameters
    ----------
    placed : placements by name, from which patches are seen
    share_own : whether a part of the held-out readings serves each recording's own parameters
    """
    banned = set(withheld)
    listed = lists_edges(patches[0])
    ws = _fitted(patches, noise)
    selection: Selection | None = None
    for trial in range(TRIALS):
        selection = select(ws, rng, withheld=banned, progress=progress, start=selection)
        model = selection.model
        if not model.effects:
            break
        progress("registering again under the model")
        model, patches, placed = _settle(model, patches, placed, recorded, noise)
        ws = _fitted(patches, noise)
        model, kept = drop_idle(ws, refit_linear(ws, model), selection.choices, rng)
        held = [p for p in patches if p.scored.any()]
        gains, _ = heldout_gains(
            ws, model, partial(judge, held, noise, share_own=share_own)
        )
        least = min(LEAST_SHARE * max(gains.values()), MUCH)
        idle = {e.name for e in model.effects if gains[e.name] < max(least, _least_of(e, listed))}
        unseen = {e.name for e in model.effects if e.name in idle and not shows(e, patches, noise)}
        if unseen:
            notes.append(f"{', '.join(sorted(unseen))}: the held-out readings can't show it")
            idle -= unseen
        if not idle:
            selection = replace(selection, model=model, choices=kept)
            break
        dropped = set(idle)
        order = [c.name for c in kept]
        denied = [name for name in order if name in idle and gains[name] < LEAST_GAIN]
        if denied and trial < TRIALS - 1:
            # what joined after an effect that doesn't hold may have mended its remainder
            dropped = set(order[order.index(denied[0]) :])
            idle = {denied[0]}
        notes.append(f"{', '.join(sorted(idle))}: fitted, but of no use on held-out readings")
        banned |= idle
        for name in dropped:
            model = model.without(name)
        model = refit_linear(ws, model)
        selection = replace(
            selection, model=model, choices=tuple(c for c in kept if c.name not in dropped)
        )
        if trial == TRIALS - 1:
            selection = replace(selection, last=screen(ws, model, rng, banned))
    assert selection is not None
    return Explanation(
        selection=selection, patches=tuple(patches), placed=placed, ws=ws
    )


def _settle(
    model: Model,
    patches: Sequence[Patch],
    placed: Mapping[str, Placement],
    recorded: Recorded,
    noise: NoiseModel,
) -> tuple[Model, Sequence[Patch], Mapping[str, Placement]]:
    """Settle where edges are and what they do, by turns."""
    for _ in range(PLACED):
        before = patches
        patches, placed = placed_anew(model, patches, recorded, placed, noise, by_law=False)
        if _same(before, patches):
            break
    if any(e.covariate in SETTLED for e in model.effects):
        model = refit(_fitted(patches, noise).thin(SEARCHED_READINGS), model)
    if _long_blur(model, patches):
        for _ in range(TURNS):
            before = patches
            patches, placed = placed_anew(model, patches, recorded, placed, noise, by_law=True)
            if _same(before, patches):
                break
            model = refit(_fitted(patches, noise).thin(SEARCHED_READINGS), model)
    return model, patches, placed


def _long_blur(model: Model, patches: Sequence[Patch]) -> bool:
    """Whether the model's blur spreads silhouettes over many pitches."""
    interval_ms = 1e3 * float(np.median(np.diff(patches[0].view.time_s)))
    return any(
        isinstance(e, MotionBlur) and (e.exposure_ms or 0.0) > LONG_BLUR * interval_ms
        for e in model.effects
    )


def _same(before: Sequence[Patch], after: Sequence[Patch]) -> bool:
    return all(a is b for a, b in zip(before, after, strict=True))


def _fitted(patches: Sequence[Patch], noise: NoiseModel) -> Workspace:
    return Workspace.build([p for p in patches if p.fit.any()], noise)
