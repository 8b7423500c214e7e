"""Full-resolution maps of each recording: mask, score, plain and explained expectation."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from diagnosis.edges import edge_softness, near_edges
from diagnosis.locate import Region, departure_mask, free_mask, regions_of, smoothed_score
from diagnosis.noise import Field, Mask, NoiseModel
from diagnosis.patch import in_range
from diagnosis.prediction import Prediction, law_of, predict
from diagnosis.registration import (
    PRIOR_SD,
    Placement,
    hits_normal,
    move,
    pose_columns,
    register,
)
from diagnosis.score import CLIP
from diagnosis.trust import Trust, bending_effects
from diagnosis.workspace import Model
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet
from sensors.effects.base import Effect
from sensors.model import SensorModel
from sensors.recording import Recording, repeated_rows
from sensors.view.view import View

CHUNK = 450_000
RIGID = 6
"""Columns of a placement that move the part; the others are the travel's."""
LEVELLED_BY = 60_000
"""Readings that tell what a placement takes up."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class RecordingMaps:
    """What mismatch.h5 holds of one recording, (n, m) each."""

    name: str
    depth_mm: NDArray[np.float32]
    mask: Mask
    score: NDArray[np.float32]
    simulated: NDArray[np.float32]
    explained: NDArray[np.float32]
    regions: tuple[Region, ...]

    def silenced(self) -> "RecordingMaps":
        """Return the same without a mismatch."""
        return replace(self, mask=np.zeros_like(self.mask), regions=())

    def everywhere(self, effect: str) -> "RecordingMaps":
        """Mark every reading: what departs is the whole recording."""
        mask = np.isfinite(self.depth_mm)
        if not mask.any():
            return self
        rows, columns = np.nonzero(mask.any(axis=1))[0], np.nonzero(mask.any(axis=0))[0]
        region = Region(
            recording=self.name,
            profiles=(int(rows[0]), int(rows[-1]) + 1),
            points=(int(columns[0]), int(columns[-1]) + 1),
            size_um=0.0,
            effect=effect,
        )
        return replace(self, mask=mask, regions=(region,))


def map_recording(
    number: int,
    recording: Recording,
    placement: Placement,
    plainly: Placement,
    scene: Scene,
    datasheet: Datasheet,
    laser: Laser,
    noise: NoiseModel,
    model: Model,
    shifts: Mapping[str, Mapping[int, Field]],
    lateral_mm: float,
    *,
    usual: float = 1.0,
    trusted: Trust | None = None,
) -> RecordingMaps:
    """Predict a whole recording piece by piece and mark where it departs.

    Parameters
    ----------
    placement, plainly : found under the model, and under the plain one
    shifts : what is left to do from there for the "final" and for the "plain" model
    usual : size of the noise that departures are held against, over the recording's
    trusted : how far what the model changes at depth edges is borne out; wholly where left out
    """
    n, m = recording.depth_mm.shape
    rows = max(8, min(n, CHUNK // m))
    parts = [slice(start, min(start + rows, n)) for start in range(0, n, rows)]
    plain_shift, final_shift = shifts["plain"][number], shifts["final"][number]
    effects = model.of(number)
    names = (
        "final", "offset", "sd", "final_sd", "noise", "final_noise", "change", "bent",
        "edge", "lost", "gone", "soft",
    )  # fmt: skip
    pieces: dict[str, list[Field]] = {k: [] for k in names}
    single: dict[str, list[Mask]] = {e.name: [] for e in model.effects}
    sensor = SensorModel(datasheet)
    whole_travel = View(scene, sensor, placement.poses, recording.time_s, laser=laser).travel_mm

    def views(poses: Field) -> Iterator[View]:
        """Look at the recording piece by piece from poses."""
        for part in parts:
            view = View(
                scene, sensor, poses[part], recording.time_s[part], laser=laser,
                intensity=None if recording.intensity is None else recording.intensity[part],
                start_time_s=recording.start_time_s, travel_mm=whole_travel[part],
            )  # fmt: skip
            yield view

    def mean_from(poses: Field, acting: Sequence[Effect]) -> Field:
        """Expect readings from poses."""
        return np.concatenate(
            [np.broadcast_to(law_of(v, acting, noise).mean_mm, v.shape) for v in views(poses)]
        )

    def expectations(first: Field, acting: Sequence[Effect], *places: Field) -> Iterator[Field]:
        """Yield one expectation after the other, so that few are held at once."""
        yield first
        for poses in places:
            yield mean_from(poses, acting)

    def columns_of(view: View, placed: Placement = placement) -> Field:
        """Change of depth (n, m, 9) by the placement, each in its prior deviations."""
        columns = pose_columns(
            view.poses, laser, view.hits.depth_mm, hits_normal(scene, view.hits),
            placed.centre_mm,
        )  # fmt: skip
        seen = np.isfinite(view.depth_mm)[..., None]
        return np.asarray(np.where(seen, columns, 0.0) * PRIOR_SD)

    def plain_nearby() -> Field:
        """Expect plain readings from where the plain model puts the recording, to first order."""
        means = []
        for view in views(plainly.poses):
            bare = np.broadcast_to(law_of(view, (), noise).mean_mm, view.shape)
            means.append(bare + columns_of(view, plainly) @ plain_shift)
        return np.concatenate(means)

    few = max(1, n * m // LEVELLED_BY)
    rigid: list[Field] = []
    samples: list[Field] = []
    for view in views(placement.poses):
        columns = columns_of(view)
        rigid.append(columns[..., :RIGID].reshape(-1, RIGID)[::few])
        plain = np.broadcast_to(law_of(view, (), noise).mean_mm, view.shape)
        edge = near_edges(view, plain)
        soft = edge_softness(view, plain, edge, lateral_mm)
        before = predict(view, (), noise, softness=soft)
        after = predict(view, effects, noise, softness=soft, level=model.level)
        pieces["final"].append(after.mean_mm + columns @ final_shift)
        pieces["offset"].append((after.mean_mm - view.depth_mm).astype(np.float32))
        pieces["edge"].append(edge)
        pieces["change"].append((after.mean_mm - before.mean_mm).astype(np.float32))
        pieces["bent"].append(pieces["change"][-1])
        if len(bending := bending_effects(effects)) < len(effects):
            bent = law_of(view, bending, noise).mean_mm
            pieces["bent"][-1] = (bent - before.mean_mm).astype(np.float32)
        samples.append(np.where(edge, np.nan, pieces["change"][-1]).reshape(-1)[::few])
        pieces["noise"].append(predict(view, (), noise).sd_mm.astype(np.float32))
        pieces["final_noise"].append(
            predict(view, effects, noise, level=model.level).sd_mm.astype(np.float32)
        )
        pieces["gone"].append(after.p_missing > 0.5)
        pieces["sd"].append(before.sd_mm.astype(np.float32))
        pieces["final_sd"].append(after.sd_mm.astype(np.float32))
        pieces["lost"].append((after.p_missing - before.p_missing).astype(np.float32))
        pieces["soft"].append(soft[1].astype(np.float32))
        for effect in effects:
            alone = predict(view, (effect,), noise, softness=soft)
            single[effect.name].append(_one(before, alone))
    whole = {k: np.concatenate(pieces.pop(k)) for k in names}
    depth = in_range(recording.depth_mm, datasheet)
    depth[repeated_rows(recording.depth_mm)] = np.nan
    # a step to first order leaves edges behind: it is also taken by casting anew
    there = {
        name: move(placed.poses, PRIOR_SD * shift, placed.centre_mm)
        for name, placed, shift in (
            ("plain", plainly, plain_shift), ("final", placement, final_shift)
        )
    }  # fmt: skip
    expected = expectations(plain_nearby(), (), there["plain"])
    plain = final = _best(depth, whole["noise"], expected)
    if effects:
        again = register(
            scene, recording, laser, datasheet=datasheet, valid=np.isfinite(depth),
            offset_mm=whole.pop("offset"), sd_mm=noise.sd_mm,
            spread=whole.pop("final_sd") / noise.sd_mm,
        )  # fmt: skip
        expected = expectations(
            whole.pop("final"), effects, there["final"], again.poses, there["plain"]
        )
        final = _best(depth, whole["final_noise"], expected)
        if trusted is not None:
            at_edges = np.nan_to_num(whole["bent"][whole["edge"]])
            shares = trusted.share(at_edges / noise.sd_mm)
            final[whole["edge"]] -= (1.0 - shares) * at_edges
    final = np.where(np.isfinite(plain), final, np.nan)
    residual = depth - plain
    score = smoothed_score(residual, whole["sd"], noise)
    plain_seen = np.isfinite(plain)
    wrong = (np.isfinite(depth) != plain_seen) & (whole["soft"] < 0.01)
    wrong[repeated_rows(recording.depth_mm)] = False
    if model.effects:
        # what the effects do beyond what any placement takes up; not the two placements found,
        # which disagree at every edge, however near they are
        taken = _taken_up(np.concatenate(samples), np.concatenate(rigid))
        moved = np.concatenate(
            [columns_of(view)[..., :RIGID] @ taken for view in views(placement.poses)]
        )
        # a wall beside an edge would move by any amount
        most = np.abs(moved[~whole["edge"]]).max(initial=0.0)
        change = whole["change"] - np.clip(moved, -most, most)
        mask = departure_mask(change, whole["lost"], usual * whole["noise"])
        mask |= _random_losses(model, wrong)
    else:
        mask = free_mask(score, np.isfinite(residual), wrong)
    named = [(name, np.concatenate(parts)) for name, parts in single.items()]
    size = 1e3 * np.where(np.isfinite(residual), residual, 0.0)
    moved = np.nan_to_num(1e3 * (final - plain))
    shown = moved if np.any(moved) else size
    return RecordingMaps(
        name=recording.name,
        depth_mm=depth.astype(np.float32),
        mask=mask,
        score=score.astype(np.float32),
        simulated=plain.astype(np.float32),
        explained=np.where(whole["gone"], np.nan, final).astype(np.float32),
        regions=tuple(regions_of(recording.name, mask, shown, named)),
    )


def _taken_up(change: Field, columns: Field) -> Field:
    """Placement (6,) that takes up most of a change (N,), by robust least squares (Cauchy)."""
    known = np.isfinite(change)
    change, columns = change[known], columns[known]
    weight = np.ones(change.size)
    found = np.zeros(columns.shape[1])
    for _ in range(5):
        normal = (columns * weight[:, None]).T @ columns
        ridge = 1e-9 * max(float(np.trace(normal)), 1e-30) * np.eye(len(normal))
        found = np.asarray(
            np.linalg.solve(normal + ridge, (columns * weight[:, None]).T @ change)
        )
        left = change - columns @ found
        scale = 1.4826 * float(np.median(np.abs(left))) + 1e-12 if left.size else 1.0
        weight = 1 / (1 + (left / (2.5 * scale)) ** 2)
    return found


def _best(depth: Field, sd_mm: Field, means: Iterable[Field]) -> Field:
    """Choose the expectation that comes nearest; readings far off count as spikes.

    Readings at edges count in full: how many lie on the wrong side tells placements apart.
    """

    def cost(mean: Field) -> float:
        far = np.square((depth - mean) / sd_mm)
        return float(np.where(np.isfinite(far), np.minimum(far, CLIP**2), CLIP**2).sum())

    return min(means, key=cost)


def _one(before: Prediction, alone: Prediction) -> Mask:
    moved = np.abs(np.nan_to_num(alone.mean_mm - before.mean_mm)) > 0.1 * before.sd_mm
    return np.asarray(
        moved | (alone.p_missing - before.p_missing > 0.002) | (alone.sd_mm > 1.1 * before.sd_mm)
    )


def _random_losses(model: Model, wrong: Mask) -> Mask:
    """Points lost at random are marked one by one where such an effect was found."""
    if any("missing" in e.channels for e in model.effects):
        return wrong
    return np.zeros_like(wrong)
