"""Full-resolution maps of each recording: mask, score, plain and explained expectation."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from diagnosis.edges import edge_softness, near_edges
from diagnosis.locate import Region, departure_mask, free_mask, regions_of, smoothed_score
from diagnosis.noise import Field, Mask, NoiseModel
from diagnosis.patch import in_range, place_travel
from diagnosis.prediction import Prediction, law_of, predict
from diagnosis.registration import PRIOR_SD, Placement, hits_normal, pose_columns
from diagnosis.workspace import Model
from sensors.datasheet import Datasheet
from sensors.laser import Laser
from sensors.recording import Recording, repeated_rows
from sensors.scene import Scene
from sensors.view import View

CHUNK = 450_000


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
    scene: Scene,
    datasheet: Datasheet,
    laser: Laser,
    noise: NoiseModel,
    model: Model,
    shifts: Mapping[str, Mapping[int, Field]],
    lateral_mm: float,
) -> RecordingMaps:
    """Predict a whole recording piece by piece and mark where it departs."""
    n, m = recording.depth_mm.shape
    rows = max(8, min(n, CHUNK // m))
    plain_shift, final_shift = shifts["plain"][number], shifts["final"][number]
    pieces: dict[str, list[Field]] = {
        k: [] for k in ("plain", "final", "sd", "lost", "moved", "soft")
    }
    single: dict[str, list[Mask]] = {e.name: [] for e in model.effects}
    whole_travel = View(scene, datasheet, placement.poses, recording.time_s, laser=laser).travel_mm
    for start in range(0, n, rows):
        part = slice(start, min(start + rows, n))
        view = View(
            scene, datasheet, placement.poses[part], recording.time_s[part], laser=laser,
            intensity=None if recording.intensity is None else recording.intensity[part],
            start_time_s=recording.start_time_s,
        )  # fmt: skip
        place_travel(view, whole_travel[part])
        columns = pose_columns(
            view.poses,
            laser,
            view.hits.depth_mm,
            hits_normal(scene, view.hits),
            placement.centre_mm,
        )
        columns = np.where(np.isfinite(view.depth_mm)[..., None], columns, 0.0) * PRIOR_SD
        plain = np.broadcast_to(law_of(view, (), noise).mean_mm, view.shape)
        soft = edge_softness(view, plain, near_edges(view, plain), lateral_mm)
        before = predict(view, (), noise, softness=soft)
        effects = model.of(number)
        after = predict(view, effects, noise, softness=soft, level=model.level)
        pieces["plain"].append(before.mean_mm + columns @ plain_shift)
        final = after.mean_mm + columns @ final_shift
        pieces["moved"].append(np.where(before.seen, final - pieces["plain"][-1], np.nan))
        pieces["final"].append(np.where(after.p_missing > 0.5, np.nan, final))
        pieces["sd"].append(before.sd_mm)
        pieces["lost"].append(after.p_missing - before.p_missing)
        pieces["soft"].append(soft[1])
        for effect in effects:
            alone = predict(view, (effect,), noise, softness=soft)
            single[effect.name].append(_one(before, alone))
    whole = {k: np.concatenate(v) for k, v in pieces.items()}
    depth = in_range(recording.depth_mm, datasheet)
    depth[repeated_rows(recording.depth_mm)] = np.nan
    residual = depth - whole["plain"]
    score = smoothed_score(residual, whole["sd"], noise)
    plain_seen = np.isfinite(whole["plain"])
    wrong = (np.isfinite(depth) != plain_seen) & (whole["soft"] < 0.01)
    wrong[repeated_rows(recording.depth_mm)] = False
    if model.effects:
        mask = departure_mask(whole["moved"], whole["lost"], whole["sd"])
        mask |= _random_losses(model, wrong)
    else:
        mask = free_mask(score, np.isfinite(residual), wrong)
    named = [(name, np.concatenate(parts)) for name, parts in single.items()]
    size = 1e3 * np.where(np.isfinite(residual), residual, 0.0)
    moved = np.nan_to_num(1e3 * whole["moved"])
    shown = moved if np.any(moved) else size
    return RecordingMaps(
        name=recording.name,
        depth_mm=depth.astype(np.float32),
        mask=mask,
        score=score.astype(np.float32),
        simulated=whole["plain"].astype(np.float32),
        explained=whole["final"].astype(np.float32),
        regions=tuple(regions_of(recording.name, mask, shown, named)),
    )


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
