"""The log predictive density of a patch, with the pose as a nuisance.

Each reading scores given its neighbours (noise/whitening.py); spikes come from a second, wide
Gaussian; a missing return scores the log probability of missing. The placement is profiled out by
generalised least squares on the readings that may be fitted, the same for every model.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numba import njit

from diagnosis.data.patch import Patch, spikes
from diagnosis.fields import Field, Mask, Single
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.noise.whitening import Whitener
from diagnosis.predict.prediction import Prediction
from diagnosis.settings import SETTINGS
from sensors.view.view_cache import ViewCache

ROOT_2PI = math.sqrt(2 * math.pi)
STRAY = 1e-4
_WHITENERS: ViewCache[Whitener] = ViewCache(3)
_COLUMNS: ViewCache[Single] = ViewCache(3)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Whitened:
    """A patch's residual under one prediction, whitened; the pose's columns with it.

    Attributes
    ----------
    used : (n, m) bool
        Readings that take part: seen by both, no spike.
    whitener : Whitener
    residual_mm : (n, m)
        Reading minus mean, 0 where not used.
    sd_mm : (n, m)
    innovations : (n, m)
        Whitened residual; 0 where not used.
    columns : (n, m, 9) float32
        Whitened derivative by the placement (in prior deviations).
    moved : (9,)
        By how much the placement differs from the patch's, in prior deviations.
    """

    used: Mask
    whitener: Whitener
    residual_mm: Field
    sd_mm: Field
    innovations: Field
    columns: Single
    moved: Field

    def whiten(self, field_mm: Field) -> Field:
        """Whiten a change of the mean (n, m), mm."""
        return self.whitener.apply(np.where(self.used, np.nan_to_num(field_mm) / self.sd_mm, 0.0))


def whitened(patch: Patch, prediction: Prediction, noise: NoiseModel) -> Whitened:
    """Whiten a patch's residual under a prediction; expensive parts are kept for the next call."""
    seen = prediction.seen & patch.observed & patch.counted
    residual = np.where(seen, patch.depth_mm - np.nan_to_num(prediction.mean_mm), 0.0)
    used = seen & ~spikes(residual, seen, prediction.sd_mm)
    whitener = _whitener(patch, used, noise)
    columns = _columns(patch, whitener, prediction.sd_mm, noise)
    innovations = whitener.apply(np.where(used, residual / prediction.sd_mm, 0.0))
    return Whitened(
        used=used,
        whitener=whitener,
        residual_mm=np.where(used, residual, 0.0),
        sd_mm=prediction.sd_mm,
        innovations=innovations,
        columns=columns,
        moved=np.zeros(columns.shape[-1]),
    )


def _whitener(patch: Patch, used: Mask, noise: NoiseModel) -> Whitener:
    key = noise, hash(np.packbits(used).tobytes())
    return _WHITENERS.get(patch, key, lambda: Whitener.build(noise, used))


def _columns(patch: Patch, whitener: Whitener, sd_mm: Field, noise: NoiseModel) -> Single:
    key = noise, hash(np.packbits(whitener.used).tobytes()), hash(sd_mm.tobytes())
    return _COLUMNS.get(patch, key, lambda: whitener.stacked(patch.columns, sd_mm))


def placements(
    patches: Sequence[Patch],
    states: Sequence[Whitened],
    masks: Sequence[Mask],
) -> dict[int, Field]:
    """Best placement (9,) of each recording given whitened residuals, in prior deviations.

    Least squares, then again without the readings that are far off under it.
    """
    found: dict[int, Field] = {}
    picks = [mask & state.used for state, mask in zip(states, masks, strict=True)]
    for _ in range(3):
        normal: dict[int, Field] = {}
        right: dict[int, Field] = {}
        for patch, state, pick in zip(patches, states, picks, strict=True):
            r, k = patch.recording, state.columns.shape[-1]
            there = found.get(r, np.zeros(k))
            clip = SETTINGS.clip if r in found else np.inf
            matrix, vector = _normal(state.columns, state.innovations, pick, there, clip)
            normal[r] = normal.get(r, np.eye(k)) + matrix
            right[r] = right.get(r, np.zeros(k)) + vector
        found = {r: np.asarray(np.linalg.solve(normal[r], right[r]), np.float64) for r in normal}
    return found


@njit(cache=True)
def _normal(
    columns: Single, values: Field, pick: Mask, there: Field, clip: float
) -> tuple[Field, Field]:
    """Products of columns (n, m, k) and values (n, m) over readings near a placement `there`."""
    n, m, k = columns.shape
    matrix, vector = np.zeros((k, k)), np.zeros(k)
    for i in range(n):
        for j in range(m):
            if not pick[i, j]:
                continue
            x = columns[i, j]
            left = values[i, j]
            for a in range(k):
                left -= x[a] * there[a]
            if not abs(left) < clip:
                continue
            for a in range(k):
                one = np.float64(x[a])
                vector[a] += one * values[i, j]
                for b in range(a + 1):
                    matrix[a, b] += one * x[b]
    for a in range(k):
        for b in range(a):
            matrix[b, a] = matrix[a, b]
    return matrix, vector


def placed(patch: Patch, state: Whitened, placement: Field) -> Whitened:
    """Return the same with the residual at a placement."""
    moved = np.where(state.used, patch.columns @ placement, 0.0)
    return replace(
        state,
        residual_mm=state.residual_mm - moved,
        innovations=state.innovations - np.where(state.used, state.columns @ placement, 0.0),
        moved=state.moved + placement,
    )


def innovations_at(
    patch: Patch, prediction: Prediction, noise: NoiseModel, placement: Field
) -> tuple[Field, Mask]:
    """Whitened residuals (n, m) at a placement, and which readings take part."""
    _, residual, used, whitener = _taken(patch, prediction, noise, placement)
    return whitener.apply(np.where(used, residual / prediction.sd_mm, 0.0)), used


def _taken(
    patch: Patch, prediction: Prediction, noise: NoiseModel, placement: Field
) -> tuple[Mask, Field, Mask, Whitener]:
    """Tell readings seen by both, their residuals, which are no spikes, and the whitener."""
    farthest = SETTINGS.data.outlier_sd
    seen, residual, used = _met(
        prediction.mean_mm, patch.columns, placement, patch.depth_mm, patch.dropped,
        prediction.sd_mm, farthest,
    )  # fmt: skip
    return seen, residual, used, _whitener(patch, used, noise)


@njit(cache=True)
def _met(
    mean: Field, columns: Field, placement: Field, depth: Field, dropped: Mask, sd: Field,
    farthest: float,
) -> tuple[Mask, Field, Mask]:  # fmt: skip
    """Tell readings seen by both, their residuals at a placement, which are within `farthest`."""
    n, m, count = columns.shape
    seen, used = np.zeros((2, n, m), dtype=np.bool_)
    residual = np.zeros((n, m))
    for i in range(n):
        if dropped[i]:
            continue
        for j in range(m):
            left = depth[i, j] - mean[i, j]
            if not np.isfinite(left):
                continue
            for k in range(count):
                left -= columns[i, j, k] * placement[k]
            seen[i, j] = True
            residual[i, j] = left
            used[i, j] = abs(left) < farthest * sd[i, j]
    return seen, residual, used


def log_density(
    patch: Patch,
    prediction: Prediction,
    noise: NoiseModel,
    placement: Field,
) -> Field:
    """Log predictive density of each reading, or of its absence, (n, m) nats; depth in mm.

    0 in profiles that aren't measurements.
    """
    seen, residual, used, whitener = _taken(patch, prediction, noise, placement)
    sd = prediction.sd_mm
    away = residual / sd
    standard = np.where(used, whitener.apply(np.where(used, away, 0.0)), away)
    return _densities(
        residual, standard, seen, np.where(used, whitener.conditional_sd(), 1.0) * sd,
        prediction.p_missing, prediction.p_outlier, prediction.outlier_sd_mm, patch.depth_mm,
        patch.dropped, patch.view.datasheet.z_range_mm,
    )  # fmt: skip


@njit(cache=True)
def _densities(
    residual: Field, standard: Field, seen: Mask, spread: Field, p_missing: Field,
    p_outlier: Field, outlier_sd: Field, depth: Field, dropped: Mask, range_mm: float,
) -> Field:  # fmt: skip
    """Log density (n, m) of readings, given what each is away from its neighbours' word.

    Parameters
    ----------
    standard, spread : that distance in its deviations, and the deviation, mm
    """
    n, m = residual.shape
    out = np.zeros((n, m))
    for i in range(n):
        if dropped[i]:
            continue
        for j in range(m):
            if np.isnan(depth[i, j]):
                out[i, j] = math.log(p_missing[i, j])
                continue
            # a reading may come from anywhere, once in ten thousand: no single one decides
            density = STRAY / range_mm
            if seen[i, j]:
                share, wide = p_outlier[i, j], residual[i, j] / outlier_sd[i, j]
                inner = (1.0 - share) * math.exp(-0.5 * standard[i, j] ** 2) / spread[i, j]
                outer = share * math.exp(-0.5 * wide**2) / outlier_sd[i, j]
                density += (inner + outer) / ROOT_2PI
            else:
                density = 1.0 / range_mm
            out[i, j] = math.log1p(-p_missing[i, j]) + math.log(density)
    return out
