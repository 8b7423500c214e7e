"""Albedo pattern of a part: two levels with a sharp border, from all recordings together.

A recorded brightness is blurred by the line and carries speckle. The centroid's bias depends on the
brightness *within* the line's width. All recordings of a part show the same pattern: their
readings, pooled over the part's x-y plane, place a border to a fraction of the pitch. Each place
has one of the two levels around it (Chan and Vese, IEEE Trans. Image Process. 10 (2001) 266, in a
window). A blur and a threshold straighten the border (Merriman, Bence and Osher, J. Comput. Phys.
112 (1994) 334).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.fft import dctn, idctn, next_fast_len

from diagnosis.data.brightness import by_direction, surface_brightness
from diagnosis.fields import Field, median_sd
from diagnosis.register.placement import Placement
from diagnosis.settings import SETTINGS
from files.yaml_document import dump_yaml
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet
from sensors.model import SensorModel
from sensors.recording import Recording
from sensors.view.view import View

PICTURE = "reflectance.png"
CELLS = 0.2
"""Side of a cell of the map over the pitch of the readings."""
BLUR = 1.5
"""Standard deviation over the pitch, that pools readings before the two levels are estimated."""
FINE = 1.0
"""Standard deviation over the pitch, that pools readings before a border is drawn."""
STRAIGHT = 1.5
"""Standard deviation over the pitch, of the window in which a border is straightened."""
WINDOW = 8.0
"""Standard deviation over the blur, of the window within which levels are the same."""
ROUNDS = 4
TURNS = 3
"""Rounds: the pattern found in one corrects the brightness by direction of the next."""
MOST_CELLS = 9_000_000
MOST_READINGS = 3_000_000
"""Readings that a pattern is drawn from at most: more need memory and resolve no more."""


@dataclass(frozen=True, slots=True, eq=False)
class AlbedoPattern:
    """Relative brightness over a part's x-y plane, in cells (a, b) from a corner, mm.

    Linear between the cells' middles: a border's place is finer than the cells.
    """

    corner_mm: Field
    cell_mm: float
    level: Field

    def at(self, part_mm: Field) -> Field:
        """Return the brightness (...,) at points (..., 3), part frame, mm; NaN where they are."""
        flat = np.reshape(part_mm[..., :2], (-1, 2))
        found = _looked_up(self.level, self.corner_mm, self.cell_mm, flat)
        return np.asarray(found.reshape(part_mm.shape[:-1]))

    def save(self, folder: Path) -> None:
        """Write reflectance.png and, with a recipe's lines for it, reflectance.yaml.

        Brightness is relative: 1 is its 99th percentile.
        """
        from matplotlib.image import imsave

        grey = np.minimum(self.level / np.quantile(self.level, 0.99), 1.0)
        # a picture's first row is at the far y
        imsave(folder / PICTURE, grey.T[::-1], cmap="gray", vmin=0.0, vmax=1.0)
        far = self.corner_mm + self.cell_mm * np.array(self.level.shape)
        (x, y) = ([float(low), float(high)] for low, high in zip(self.corner_mm, far, strict=True))
        lines = {"reflectance": {"picture": {"path": PICTURE, "x_mm": x, "y_mm": y}}}
        (folder / "reflectance.yaml").write_text(dump_yaml(lines), encoding="utf-8")


def find_albedo(intensities: Sequence[Field], views: Sequence[View]) -> AlbedoPattern | None:
    """Find a pattern that all recordings show; None where brightness follows directions alone.

    Parameters
    ----------
    intensities : (n, m) each, as recorded
    views : of the part at the placements of the recordings
    """
    lit, pitches = [], []
    for intensity, view in zip(intensities, views, strict=True):
        with np.errstate(invalid="ignore"):
            square = view.cos_incidence > SETTINGS.data.pattern_cos
            usable = np.isfinite(view.depth_mm) & square
            lit.append(usable & (intensity > 0))
        if not lit[-1].any():
            return None
        steps = np.abs(view.travel_step_mm), np.abs(np.diff(view.column_x_mm))
        pitches.append(float(np.sqrt(np.median(steps[0]) * np.median(steps[1]))))
    place = np.concatenate([v.part_mm[here][:, :2] for v, here in zip(views, lit, strict=True)])
    found: AlbedoPattern | None = None
    for _ in range(TURNS):
        logs = []
        for intensity, view, here in zip(intensities, views, lit, strict=True):
            plain = intensity if found is None else intensity / found.at(view.part_mm)
            logs.append(np.log((intensity / by_direction(plain, view))[here]))
        found = _drawn(place, np.concatenate(logs), float(np.median(pitches)))
        if found is None:
            break
    return found


def with_brightness(
    recordings: Sequence[Recording],
    placed: Mapping[str, Placement],
    scene: Scene,
    datasheet: Datasheet,
    laser: Mapping[str, Laser],
) -> tuple[Scene, list[Recording]]:
    """Return the part with its albedo, and recordings with the surface's part of their brightness.

    Parameters
    ----------
    placed, laser : of each recording, by its name
    """
    few = sum(r.depth_mm.size for r in recordings) <= MOST_READINGS
    views, kept = [], []
    for recording in recordings:
        if recording.intensity is None:
            kept.append(recording)
            continue
        view = View(
            scene, SensorModel(datasheet), placed[recording.name].poses, recording.time_s,
            laser=laser[recording.name],
        )  # fmt: skip
        bright = surface_brightness(recording.intensity, view)
        kept.append(replace(recording, intensity=bright))
        if few:
            views.append(view)
    if len(views) < len(recordings):
        return scene, kept
    found = find_albedo([r.intensity for r in recordings if r.intensity is not None], views)
    if found is None:
        return scene, kept
    for k, (recording, view) in enumerate(zip(recordings, views, strict=True)):
        seen = recording.intensity
        levels = None if seen is None else _on_levels(seen, view, found)
        if levels is not None:
            kept[k] = replace(recording, intensity=levels)
    return scene.finished(found), kept


def _on_levels(intensity: Field, view: View, pattern: AlbedoPattern) -> Field | None:
    """Return a recorded brightness (n, m) on one of two levels, or between them, without speckle.

    Between them where it is clear of both: there the line lies on a border, and how bright it is
    says where to a fraction of the line's width. None where speckle hides what is between.
    """
    across = np.median(np.abs(view.travel_step_mm)) * view.poses[:, None, :3, 1]
    beside = np.stack([pattern.at(view.part_mm + step * across) for step in (-1.0, 0.0, 1.0)])
    low, middle, high = np.log(np.sort(beside, axis=0))
    usual = by_direction(intensity / beside[1], view)
    with np.errstate(invalid="ignore", divide="ignore"):
        log = np.log(intensity / usual)
    plain = np.isfinite(log) & (high - low < SETTINGS.data.pattern_step)
    border = high - low >= SETTINGS.data.pattern_step
    if not (plain.any() and border.any()):
        return None
    speckle = median_sd((log - middle)[plain])
    if np.median((high - low)[border]) < 2 * SETTINGS.data.border_sd * speckle:
        return None
    nearest = np.where(2 * log < low + high, low, high)
    clear = np.abs(log - nearest) > SETTINGS.data.border_sd * speckle
    return np.asarray(np.exp(np.where(clear, np.clip(log, low, high), nearest)) * usual)


@njit(cache=True)
def _looked_up(level: Field, corner_mm: Field, cell_mm: float, place_mm: Field) -> Field:
    far_a, far_b = level.shape[0] - 1.0, level.shape[1] - 1.0
    out = np.empty(len(place_mm))
    for k in range(len(place_mm)):
        u = (place_mm[k, 0] - corner_mm[0]) / cell_mm - 0.5
        v = (place_mm[k, 1] - corner_mm[1]) / cell_mm - 0.5
        if not (math.isfinite(u) and math.isfinite(v)):
            out[k] = math.nan
            continue
        u, v = min(max(u, 0.0), far_a), min(max(v, 0.0), far_b)
        a, b = min(int(u), level.shape[0] - 2), min(int(v), level.shape[1] - 2)
        s, t = u - a, v - b
        near = (1 - t) * level[a, b] + t * level[a, b + 1]
        far = (1 - t) * level[a + 1, b] + t * level[a + 1, b + 1]
        out[k] = (1 - s) * near + s * far
    return out


def _drawn(place_mm: Field, log: Field, pitch_mm: float) -> AlbedoPattern | None:
    """Draw the borders between two levels, readings (N, 2) of a brightness's logarithm (N,)."""
    corner = place_mm.min(axis=0) - WINDOW * pitch_mm
    extent = place_mm.max(axis=0) + WINDOW * pitch_mm - corner
    cell = max(CELLS * pitch_mm, float(np.sqrt(extent.prod() / MOST_CELLS)))
    shape = tuple(next_fast_len(int(size), real=True) for size in np.ceil(extent / cell))
    index = np.ravel_multi_index(tuple(((place_mm - corner) / cell).astype(int).T), shape)
    count = _binned(index, None, shape)
    total = _binned(index, log, shape)
    blur = BLUR * pitch_mm / cell
    smooth = _mean(total, count, blur)
    wide = WINDOW * blur
    sums, counts = _blurred(total, wide), _blurred(count, wide)
    middle = _ratio(sums, counts)
    low = high = middle
    for _ in range(ROUNDS):
        bright = smooth > middle
        upper, above = _blurred(total * bright, wide), _blurred(count * bright, wide)
        low, high = _ratio(sums - upper, counts - above), _ratio(upper, above)
        middle = 0.5 * (low + high)
    step, least = high - low, SETTINGS.data.pattern_step
    if np.median(step.ravel()[index]) < least:
        return None
    # speckle frays a border: what differs from most around it changes sides
    frayed = _mean(total, count, FINE * pitch_mm / cell) > middle
    bright = _blurred(frayed.astype(np.float64), STRAIGHT * pitch_mm / cell) > 0.5
    level = np.where(step < least, smooth, np.where(bright, high, low))
    return AlbedoPattern(corner_mm=corner, cell_mm=cell, level=np.exp(level))


def _binned(index: NDArray[np.int64], values: Field | None, shape: tuple[int, ...]) -> Field:
    size = int(np.prod(shape))
    return np.bincount(index, values, size).reshape(shape).astype(np.float64)


def _mean(total: Field, count: Field, sd: float) -> Field:
    """Mean of the readings in a window, `sd` cells."""
    return _ratio(_blurred(total, sd), _blurred(count, sd))


def _ratio(total: Field, count: Field) -> Field:
    return np.asarray(total / np.maximum(count, 1e-12))


def _blurred(field: Field, sd: float) -> Field:
    """Blur by a Gaussian of any width, mirrored at the borders: a product of cosine waves."""
    waves = dctn(field)
    for axis, size in enumerate(field.shape):
        fade = np.exp(-0.5 * np.square(np.pi * sd / size * np.arange(size)))
        waves *= np.expand_dims(fade, 1 - axis)
    return np.asarray(idctn(waves))
