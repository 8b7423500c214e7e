"""Detection beside the mean: variance, missing returns, spikes, over every covariate.

Each reading gives a number whose expectation the plain model knows (squared innovation, missing or
not, spike or not). Their departure is regressed on hat functions of a covariate; blocks of readings
count as independent, so correlation needs no model (a sandwich over blocks).
"""

from collections.abc import Sequence

import numpy as np
from scipy import stats
from scipy.ndimage import binary_dilation, label

from diagnosis.families import covariate_values, hats
from diagnosis.finding import Finding
from diagnosis.noise import Field, Mask, NoiseModel
from diagnosis.patch import Patch
from diagnosis.prediction import Prediction
from diagnosis.score import Whitened
from diagnosis.workspace import block_sums
from sensors.effects.base import Effect
from sensors.view.covariates import COVARIATES

TOLERANCES = {"variance": 0.12, "missing": 0.004, "tails": 0.002}
"""Least departure that is a mismatch: change of the noise (rms over readings), share of them."""
LISTED_TOLERANCE = 0.15
"""The same for the noise where the sensor's file shapes it over the scan already."""
MODELLED_TOLERANCE = 0.3
"""The same beside an effect that was found and shapes the noise: its law is an approximation."""
LEVELS = {"missing": 0.002, "tails": 0.0007}
"""Least share of readings, lost or spikes, that is a mismatch by itself."""
LARGEST_EVENT = 12
WATCHED = (
    "incidence", "slope_x", "slope_y", "half_vector", "depth", "x", "brightness", "time",
    "column", "hidden",
)  # fmt: skip


def screen_rates(
    patches: Sequence[Patch],
    predictions: Sequence[Prediction],
    states: Sequence[Whitened],
    noise: NoiseModel,
    block: tuple[int, int],
    accepted: Sequence[Effect] = (),
) -> list[Finding]:
    """Test variance, missing and tails against nothing and against each covariate.

    Parameters
    ----------
    accepted : effects that the predictions follow, beside those of the sensor's file
    """
    findings: list[Finding] = []
    shaped = any("variance" in e.channels for e in patches[0].view.sensor.effects)
    # weak light is noisy where it isn't lost
    modelled = any("variance" in e.channels or e.name == "specular_dropout" for e in accepted)
    for channel in ("variance", "missing", "tails"):
        tolerance = TOLERANCES[channel]
        if channel == "variance" and (shaped or modelled):
            tolerance = MODELLED_TOLERANCE if modelled else LISTED_TOLERANCE
        values, masks, floor = _numbers(channel, patches, predictions, states, noise)
        if sum(int(m.sum()) for m in masks) < 200:
            continue
        findings += _overall(channel, values, masks, floor)
        for name in WATCHED:
            covariate = covariate_values(name, patches)
            if covariate is None or all(
                np.ptp(c[np.isfinite(c)]) == 0 for c in covariate if np.isfinite(c).any()
            ):
                continue
            numbers = values, masks, floor
            if channel == "missing" and name == "hidden":
                numbers = _numbers(channel, patches, predictions, states, noise, shadows=True)
            finding = _against(channel, name, *numbers, covariate, block, tolerance)
            if finding is not None:
                findings.append(finding)
    return findings


def _numbers(
    channel: str,
    patches: Sequence[Patch],
    predictions: Sequence[Prediction],
    states: Sequence[Whitened],
    noise: NoiseModel,
    *,
    shadows: bool = False,
) -> tuple[list[Field], list[Mask], float]:
    """Departure of each reading from its expectation, where it counts, and its least variance."""
    values, masks = [], []
    for patch, prediction, state in zip(patches, predictions, states, strict=True):
        ambiguous = binary_dilation(patch.softness[1] > 0.01, iterations=1)
        near = patch.fit & patch.counted & prediction.seen & ~ambiguous
        inside = near & ~patch.edge
        if channel == "variance":
            square = np.minimum(state.innovations**2, 9.0)
            values.append(square)
            sharp = patch.softness[0] > 0.3 * noise.sd_mm
            masks.append(inside & state.used & ~sharp)
        elif channel == "missing":
            values.append(np.where(patch.observed, 0.0, 1.0) - prediction.p_missing)
            # shadows lie beside edges
            masks.append(near if shadows else inside)
        else:
            seen = inside & patch.observed
            usual = np.where(prediction.p_outlier > 3e-4, prediction.p_outlier, noise.tail_share)
            values.append(np.where(seen & ~state.used, 1.0, 0.0) - usual)
            masks.append(seen)
    if channel == "variance":
        everything = np.concatenate([v[m] for v, m in zip(values, masks, strict=True)])
        level = float(everything.mean()) if everything.size else 1.0
        values = [v / max(level, 1e-6) - 1 for v in values]
        return values, masks, 0.5
    # the model's own expectation says how much such counts scatter at least
    share = noise.missing_share if channel == "missing" else noise.tail_share
    expected = [
        (q.p_missing if channel == "missing" else q.p_outlier)[m]
        for q, m in zip(predictions, masks, strict=True)
    ]
    return values, masks, max(share, float(np.concatenate(expected).mean()), 1e-4)


def _overall(
    channel: str,
    values: Sequence[Field],
    masks: Sequence[Mask],
    floor: float,
) -> list[Finding]:
    """Level of missing or spikes against the plain model's; the noise's level is tested apart."""
    if channel == "variance":
        return []
    count = sum(int(m.sum()) for m in masks)
    share = sum(float(v[m].sum()) for v, m in zip(values, masks, strict=True)) / count
    # the plain model loses readings one by one; a patch of lost ones counts as a few events
    events = sum(_events((v > 0.5) & m) for v, m in zip(values, masks, strict=True))
    usual = sum(float(((v > 0.5) - v)[m].sum()) for v, m in zip(values, masks, strict=True))
    expected = max(floor * count, usual)
    log_tail = stats.poisson.logsf(events - 1, expected) if events else 0.0
    z = (
        float(stats.norm.isf(np.exp(log_tail)))
        if log_tail > -600
        else float(np.sqrt(-2 * log_tail))
    )
    if channel == "tails":
        z *= 0.7  # real noise has heavier shoulders than a Gaussian's
    return [
        Finding(
            channel=channel, name=f"level:{channel}", words="nothing in particular", frame="sensor",
            z=z if events > 12 else 0.0, size=share, tolerance=LEVELS[channel],
            gain=max(0.0, 0.5 * z * z), coefficients=np.array([share]),
        )
    ]  # fmt: skip


def _events(marked: Mask) -> int:
    """Count marked readings, those of one connected patch as LARGEST_EVENT at most."""
    marks, _ = label(marked)
    return int(np.minimum(np.bincount(marks.ravel())[1:], LARGEST_EVENT).sum())


def _against(
    channel: str,
    name: str,
    values: Sequence[Field],
    masks: Sequence[Mask],
    floor: float,
    covariate: Sequence[Field],
    block: tuple[int, int],
    tolerance: float,
) -> Finding | None:
    fields = hats([np.where(m, c, np.nan) for m, c in zip(masks, covariate, strict=True)], 6)
    if fields[0] is None or len(fields[0]) < 2:
        return None
    weight = np.array(
        [
            sum(float(f[k][m].sum()) for f, m in zip(fields, masks, strict=True) if f is not None)
            for k in range(len(fields[0]))
        ]
    )
    kept = weight > 50
    if kept.sum() < 2:
        return None
    sums = []
    weights = []
    for value, mask, field in zip(values, masks, fields, strict=True):
        assert field is not None
        sums.append(
            np.stack(
                [block_sums(np.where(mask, value * f, 0.0), block) for f in field[kept]], axis=1
            )
        )
        weights.append(
            np.stack([block_sums(np.where(mask, f, 0.0), block) for f in field[kept]], axis=1)
        )
    total, mass = np.concatenate(sums), np.concatenate(weights)
    rate = total.sum(axis=0) / mass.sum(axis=0)
    centre = float(total.sum() / mass.sum()) if channel == "variance" else 0.0
    departure = total - centre * mass
    score = departure.sum(axis=0)
    blocks = int((mass.sum(axis=1) > 0).sum())
    rest = total - rate * mass
    spread = rest.T @ rest * blocks / max(blocks - 1, 1) + np.diag(floor * mass.sum(axis=0))
    dof = int(kept.sum()) - (1 if channel == "variance" else 0)
    if blocks <= 2 * dof + 4:
        return None
    solved, *_ = np.linalg.lstsq(spread, score, rcond=1e-8)
    statistic = float(score @ solved)
    # Hotelling's small-sample correction
    f = statistic * (blocks - dof) / (dof * max(blocks - 1, 1))
    log_tail = stats.f.logsf(f, dof, blocks - dof)
    z = (
        float(stats.norm.isf(np.exp(log_tail)))
        if log_tail > -600
        else float(np.sqrt(-2 * log_tail))
    )
    if channel == "variance":
        change = np.sqrt(np.clip(1 + rate - centre, 0.05, None)) - 1
        size = float(np.sqrt(np.average(change**2, weights=mass.sum(axis=0))))
    else:
        size = float(rate.max())
        if rate.max() <= 0:
            z = 0.0
    c = COVARIATES[name]
    return Finding(
        channel=channel, name=f"{channel}:{name}", words=c.words, frame=c.frame, z=z, size=size,
        tolerance=tolerance, gain=0.5 * max(statistic - dof, 0.0), coefficients=rate,
    )  # fmt: skip
