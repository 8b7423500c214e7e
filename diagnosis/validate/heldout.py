"""Judging on readings that nothing was fitted to: score, size, distribution, coverage.

Only the placement is refitted, and parameters that belong to a recording are estimated on a small
part of it that is then not scored; the same for both models.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr

from diagnosis.data.patch import Patch
from diagnosis.fields import Field, Mask
from diagnosis.model.blocks import bootstrap_interval
from diagnosis.model.log_density import log_density, placed, placements, whitened
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.physics.linear_fit import phase_is_own, solve_linear
from diagnosis.settings import SETTINGS

ENDS = 0.6745, 1.6449
"""Deviations that hold 50 % and 90 % of Gaussian values."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Judgement:
    """One model on held-out readings.

    Attributes
    ----------
    log_score : nats per reading, lower is better
    bulk_score : the same for the readings that no depth edge reaches, so many as `bulk`
    rms_um : of reading minus expectation, spikes included up to 6 deviations
    ks : largest gap between the distribution of standardised readings and the normal's
    coverage : share of readings inside the central 50 % and 90 %
    brier : mean square of missing minus its probability
    blocks : log score of each block, summed; `counts` its readings
    residuals_mm : for each patch (n, m), NaN where there is none
    """

    log_score: float
    bulk_score: float
    bulk: int
    rms_um: float
    ks: float
    coverage: tuple[float, float]
    brier: float
    blocks: Field
    counts: Field
    residuals_mm: tuple[Field, ...]
    means_mm: tuple[Field, ...]
    rms_in_um: float | None = None
    rms_out_um: float | None = None

    def as_json(self, rng: np.random.Generator) -> dict[str, object]:
        """Return the figures for diagnosis.json."""
        total = float(self.counts.sum())
        low, high = bootstrap_interval(self.blocks, rng)
        out: dict[str, object] = {
            "log_score": self.log_score,
            "rms_um": self.rms_um,
            "ks": self.ks,
            "log_score_low": -high / total,
            "log_score_high": -low / total,
            "coverage_50": self.coverage[0],
            "coverage_90": self.coverage[1],
            "missing_brier": self.brier,
        }
        if self.rms_in_um is not None:
            out["rms_in_regions_um"] = self.rms_in_um
        if self.rms_out_um is not None:
            out["rms_outside_regions_um"] = self.rms_out_um
        return out


def own_parts(masks: Sequence[Mask]) -> tuple[list[Mask], list[Mask]]:
    """Divide readings: those for a recording's own parameters, and those to judge on.

    A recording of few profiles has smaller groups, so that most of it is judged on.
    """
    every, most, small = SETTINGS.validate.own_every, SETTINGS.validate.group_profiles, []
    for mask in masks:
        size = max(1, min(most, len(mask) // every))
        group = (np.arange(len(mask)) // size) % every == 0
        small.append(group[:, None] & mask)
    return small, [m & ~s for m, s in zip(masks, small, strict=True)]


def judging_masks(patches: Sequence[Patch], share_own: bool) -> tuple[list[Mask], list[Mask]]:
    """Choose readings for a recording's own parameters, and readings to score."""
    inside = [p.scored & p.counted for p in patches]
    return own_parts(inside) if share_own else ([np.zeros_like(m) for m in inside], inside)


def settle_own(
    ws: Workspace, model: Model, small: Sequence[Mask], *, only: str | None = None
) -> Model:
    """Estimate each recording's own parameters on the small part, of one effect or of all."""
    for effect in model.effects:
        if not phase_is_own(effect) or only not in (None, effect.name):
            continue
        rest = model.refitting(effect.name)
        predictions = ws.predict(rest)
        raw = [whitened(p, q, ws.noise) for p, q in zip(ws.patches, predictions, strict=True)]
        moved = placements(ws.patches, raw, small)
        states = [placed(p, s, moved[p.recording]) for p, s in zip(ws.patches, raw, strict=True)]
        fitted = solve_linear(effect, ws, states, small)
        if fitted is not None:
            # the amplitude stays the instrument's, only the phases are the recording's
            model = rest.with_effect(effect, fitted.own)
    return model


def with_own(
    patches: Sequence[Patch], noise: NoiseModel, model: Model, *, share_own: bool
) -> Model:
    """Return the model with held-out recordings' own parameters, estimated on their small parts.

    Those that the model has already stay as they are.
    """
    held = [p for p in patches if p.scored.any()]
    if not share_own or not held or not any(phase_is_own(e) for e in model.effects):
        return model
    small, _ = judging_masks(held, True)
    found = settle_own(Workspace.build(held, noise), model, small)
    own = {r: dict(values) for r, values in found.own.items()}
    for r, values in model.own.items():
        own.setdefault(r, {}).update(values)
    return replace(model, own=own)


def largest_gap(values: Field) -> float:
    """Return the largest gap of an empirical distribution to the normal's (Kolmogorov)."""
    if not values.size:
        return float("nan")
    expected = ndtr(np.sort(values))
    steps = np.arange(values.size + 1) / values.size
    return float(max((steps[1:] - expected).max(), (expected - steps[:-1]).max()))


def judge(
    patches: Sequence[Patch],
    noise: NoiseModel,
    model: Model,
    *,
    share_own: bool,
    regions: Sequence[Mask] | None = None,
) -> Judgement:
    """Score one model on the readings held out."""
    ws = Workspace.build(patches, noise)
    _, scored = judging_masks(patches, share_own)
    model = with_own(patches, noise, model, share_own=share_own)
    predictions = ws.predict(model)
    states = [whitened(p, q, noise) for p, q in zip(patches, predictions, strict=True)]
    moved = placements(patches, states, [p.counted for p in patches])
    densities, residuals, means, standard, inside, missing = [], [], [], [], [], []
    for patch, prediction, mask in zip(patches, predictions, scored, strict=True):
        shift = moved[patch.recording]
        densities.append(log_density(patch, prediction, noise, shift))
        mean = prediction.mean_mm + patch.columns @ shift
        means.append(mean)
        residual = np.where(mask & patch.observed, patch.depth_mm - mean, np.nan)
        residuals.append(residual)
        both = np.isfinite(residual)
        standard.append((residual / prediction.sd_mm)[both])
        inside.append(both)
        missing.append(((~patch.observed).astype(float) - prediction.p_missing)[mask] ** 2)
    z = np.concatenate(standard)
    e = np.concatenate([r[b] for r, b in zip(residuals, inside, strict=True)])
    bulk = [m & ~p.edge for p, m in zip(patches, scored, strict=True)]
    in_bulk = sum(float(d[m].sum()) for d, m in zip(densities, bulk, strict=True))
    smooth = sum(int(m.sum()) for m in bulk)
    limit = 1.0  # mm; a reading on another level isn't noise of the mean
    clipped = np.clip(e, -limit, limit)
    blocks = ws.block_scores(densities, scored)
    counts = ws.block_scores([m.astype(float) for m in scored], scored)
    rms: list[float | None] = [None, None]
    if regions is not None:
        for k, wanted in enumerate((True, False)):
            part = np.concatenate(
                [r[b & (g == wanted)] for r, b, g in zip(residuals, inside, regions, strict=True)]
            )
            rms[k] = (
                1e3 * float(np.sqrt(np.mean(np.clip(part, -limit, limit) ** 2)))
                if part.size
                else None
            )
    return Judgement(
        log_score=-float(blocks.sum()) / max(float(counts.sum()), 1.0),
        bulk_score=-in_bulk / max(smooth, 1),
        bulk=smooth,
        rms_um=1e3 * float(np.sqrt(np.mean(clipped**2))) if e.size else float("nan"),
        ks=largest_gap(z),
        coverage=_coverage(z),
        brier=float(np.concatenate(missing).mean()) if z.size else 0.0,
        blocks=blocks,
        counts=counts,
        residuals_mm=tuple(residuals),
        means_mm=tuple(means),
        rms_in_um=rms[0],
        rms_out_um=rms[1],
    )  # fmt: skip


def _coverage(standard: Field) -> tuple[float, float]:
    """Share of standardised residuals inside the central 50 % and 90 %."""
    if standard.size == 0:
        return 0.0, 0.0
    size = np.abs(standard)
    half, most = (float(np.mean(size < end)) for end in ENDS)
    return half, most
