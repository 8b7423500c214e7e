"""Full-resolution maps of each recording: mask, score, plain and explained expectation."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from diagnosis.data.patch import in_range
from diagnosis.data.recorded import Recorded
from diagnosis.fields import Field, Mask, Single, median_sd
from diagnosis.localise.regions import Region, departure_mask, free_mask, regions_of, smoothed_score
from diagnosis.model.model import Model
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.predict.edges import edge_softness, near_edges
from diagnosis.predict.expectation import expect
from diagnosis.predict.prediction import Prediction, law_of, predict
from diagnosis.register.placement import PRIOR_SD, Placement
from diagnosis.register.pose_derivative import pose_columns, travel_columns
from diagnosis.register.registration import hits_normal
from diagnosis.settings import SETTINGS
from diagnosis.validate.placement_candidates import Placed
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


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Pieces:
    """A whole recording looked at piece by piece from where a model places it.

    Attributes
    ----------
    shift : residual of the placement to first order, in prior deviations
    """

    recorded: Recorded
    number: int
    placement: Placement
    shift: Field

    @property
    def recording(self) -> Recording:
        """The recording."""
        return self.recorded.recordings[self.number]

    def views(self) -> Iterator[tuple[slice, View]]:
        """Yield successive profiles and the view of them."""
        recording, poses = self.recording, self.placement.poses
        n, m = recording.depth_mm.shape
        rows = max(8, min(n, CHUNK // m))
        whole = View(
            self.recorded.scene, SensorModel(self.recorded.datasheet), poses, recording.time_s,
            laser=self.recorded.rays(self.number), intensity=recording.intensity,
            start_time_s=recording.start_time_s,
        )  # fmt: skip
        for part in (slice(start, min(start + rows, n)) for start in range(0, n, rows)):
            yield part, whole.rows(part)

    def columns(self, part: slice, view: View) -> Field:
        """Change of depth (n, m, 9) by the placement, each in its prior deviations."""
        columns = pose_columns(
            view.poses, view.laser, view.hits.depth_mm,
            hits_normal(self.recorded.scene, view.hits), self.placement.centre_mm,
            travel_columns(self.placement.poses)[part],
        )  # fmt: skip
        seen = np.isfinite(view.depth_mm)[..., None]
        return np.asarray(np.where(seen, columns, 0.0) * PRIOR_SD)

    def edges(self, view: View, noise: NoiseModel) -> tuple[Mask, tuple[Field, Field]]:
        """Where depth edges reach, and by how much they may be misplaced."""
        plain = np.broadcast_to(law_of(view, (), noise).mean_mm, view.shape)
        edge = near_edges(view, plain)
        return edge, edge_softness(view, plain, edge, self.recorded.lateral_mm)


def expected(
    recorded: Recorded, number: int, placed: Placed, noise: NoiseModel
) -> Field:
    """Compute the expected depth of a whole recording where a model places it, (n, m) mm."""
    pieces = Pieces(
        recorded=recorded, number=number, placement=placed.places[number].placement,
        shift=placed.shifts[number],
    )  # fmt: skip
    model, means = placed.model, []
    for part, view in pieces.views():
        edge, soft = pieces.edges(view, noise)
        law = expect(
            view, model.of(number), noise, edge, softness=soft, level=model.level,
            shares=model.shares,
        )  # fmt: skip
        means.append(law.mean_mm + pieces.columns(part, view) @ pieces.shift)
    return np.concatenate(means)


def map_recording(
    recorded: Recorded,
    number: int,
    nominal: Placed,
    found: Placed,
    noise: NoiseModel,
    *,
    usual: float = 1.0,
    late: bool = False,
) -> RecordingMaps:
    """Predict a whole recording piece by piece and mark where it departs.

    Parameters
    ----------
    nominal, found : where the recordings lie under the nominal model and under that found
    usual : size of the noise that departures are held against, over the recording's
    late : whether profiles that repeat the one before are expected where that was measured
    """
    recording = recorded.recordings[number]
    depth = in_range(recording.depth_mm, recorded.datasheet)
    repeated = repeated_rows(recording.depth_mm)
    depth[repeated] = np.nan
    plain = expected(recorded, number, nominal, noise)
    final = plain if found.model.is_nominal else expected(recorded, number, found, noise)
    measured = measured_at(repeated) if late else np.arange(len(final))
    lag = np.nan_to_num(final[measured] - final)
    final = np.where(np.isfinite(plain), final[measured], np.nan)
    changes = _changes(recorded, number, found, noise)
    residual = depth - plain
    score = smoothed_score(residual, changes.sd_mm, noise)
    wrong = (np.isfinite(depth) != np.isfinite(plain)) & (changes.soft < SETTINGS.ambiguous)
    wrong[repeated] = False
    if found.model.is_nominal and not lag.any():
        mask = free_mask(score, wrong)
    else:
        departure = changes.departure_mm + lag
        mask = departure_mask(departure, changes.lost, changes.noise_mm * usual)
        mask |= _random_losses(found.model, wrong)
    size = 1e3 * np.where(np.isfinite(residual), residual, 0.0)
    moved = np.nan_to_num(1e3 * (final - plain))
    shown = moved if np.any(moved) else size
    return RecordingMaps(
        name=recording.name,
        depth_mm=depth.astype(np.float32),
        mask=mask,
        score=score,
        simulated=plain.astype(np.float32),
        explained=np.where(changes.gone[measured], np.nan, final).astype(np.float32),
        regions=tuple(regions_of(recording.name, mask, shown, changes.alone)),
    )


def measured_at(repeated: Mask) -> NDArray[np.intp]:
    """Return the number of the profile that each (n,) repeats, or its own."""
    return np.maximum.accumulate(np.where(repeated, 0, np.arange(repeated.size)))


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Changes:
    """What effects change of a whole recording, (n, m) each.

    Attributes
    ----------
    departure_mm : of the mean, beyond what a placement takes up
    lost : of the probability of missing
    sd_mm, noise_mm : size of the nominal noise, with and without what edges add
    gone : more likely missing than not
    soft : chance that a reading belongs to the other side of an edge
    alone : where each effect alone departs
    """

    departure_mm: Field | Single
    lost: Single
    sd_mm: Single
    noise_mm: Single
    gone: Mask
    soft: Single
    alone: tuple[tuple[str, Mask], ...]


def _changes(recorded: Recorded, number: int, found: Placed, noise: NoiseModel) -> _Changes:
    pieces = Pieces(
        recorded=recorded, number=number, placement=found.places[number].placement,
        shift=found.shifts[number],
    )  # fmt: skip
    model, effects = found.model, found.model.of(number)
    few = max(1, recorded.recordings[number].depth_mm.size // LEVELLED_BY)
    out: dict[str, list[Single]] = {k: [] for k in ("change", "lost", "sd", "noise", "soft")}
    edges: list[Mask] = []
    gone: list[Mask] = []
    causes = model.by_cause(number)
    alone: dict[str, list[Mask]] = {name: [] for name in causes}
    rigid: list[Field] = []
    samples: list[Single] = []
    for part, view in pieces.views():
        edge, soft = pieces.edges(view, noise)
        before = predict(view, (), noise, softness=soft)
        after = predict(view, effects, noise, softness=soft, level=model.level)
        change = (after.mean_mm - before.mean_mm).astype(np.float32)
        rigid.append(pieces.columns(part, view)[..., :RIGID].reshape(-1, RIGID)[::few])
        samples.append(np.where(edge, np.nan, change).reshape(-1)[::few])
        out["change"].append(change)
        out["lost"].append((after.p_missing - before.p_missing).astype(np.float32))
        out["sd"].append(before.sd_mm.astype(np.float32))
        out["noise"].append(predict(view, (), noise).sd_mm.astype(np.float32))
        gone.append(after.p_missing > 0.5)
        out["soft"].append(soft[1].astype(np.float32))
        edges.append(edge)
        for name, own in causes.items():
            by_itself = predict(view, own, noise, softness=soft)
            alone[name].append(_one(before, by_itself))
    whole = {k: np.concatenate(v) for k, v in out.items()}
    departure: Field | Single = whole["change"]
    if effects:
        # what the effects do beyond what any placement takes up; not the two placements found,
        # which disagree at every edge, however near they are
        taken = taken_up(np.concatenate(samples), np.concatenate(rigid))
        moved = np.concatenate([pieces.columns(*p)[..., :RIGID] @ taken for p in pieces.views()])
        # a wall beside an edge would move by any amount
        most = np.abs(moved[~np.concatenate(edges)]).max(initial=0.0)
        departure = departure - np.clip(moved, -most, most)
    return _Changes(
        departure_mm=departure, lost=whole["lost"], sd_mm=whole["sd"], noise_mm=whole["noise"],
        gone=np.concatenate(gone), soft=whole["soft"],
        alone=tuple((name, np.concatenate(parts)) for name, parts in alone.items()),
    )  # fmt: skip


def taken_up(change: Field, columns: Field) -> Field:
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
        scale = median_sd(left) + 1e-12 if left.size else 1.0
        weight = 1 / (1 + (left / (2.5 * scale)) ** 2)
    return found


def _one(before: Prediction, alone: Prediction) -> Mask:
    least, least_lost = SETTINGS.localise.alone_sd, SETTINGS.localise.alone_lost
    moved = np.abs(np.nan_to_num(alone.mean_mm - before.mean_mm)) > least * before.sd_mm
    noisier = alone.sd_mm > (1 + least) * before.sd_mm
    return np.asarray(moved | (alone.p_missing - before.p_missing > least_lost) | noisier)


def _random_losses(model: Model, wrong: Mask) -> Mask:
    """Points lost at random are marked one by one where such an effect was found."""
    if any("missing" in e.channels for e in model.effects):
        return wrong
    return np.zeros_like(wrong)
