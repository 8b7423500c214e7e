"""Detection in the mean: every family of signatures against the noise, the pose projected out.

Statistics are sums of squares of whitened residuals along a family's fields, orthogonal to the
placement's columns (Frisch and Waugh 1933). Their null is drawn: fields with the calibrated
spectrum, the real pattern of missing readings and the same rounding, the same processing, the
maximum over all statistics; its tail is continued by a Gumbel law where draws are few.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from diagnosis.columnwise import column_equations
from diagnosis.families import Family
from diagnosis.noise import Field, Mask, NoiseModel
from diagnosis.patch import Patch
from diagnosis.rangewise import strongest_wave
from diagnosis.rowwise import RowTests
from diagnosis.score import CLIP, Whitened

LEVEL = 1e-3
DRAWS = 48
TOLERANCE = 0.1
"""A departure of the mean below this share of the noise is no mismatch, however significant."""
EDGE_TOLERANCE = 0.6
"""The same where a signature lives on depth edges, which no mesh and no pose place exactly."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Finding:
    """One statistic.

    Attributes
    ----------
    z : float
        Strength as a Gaussian deviate.
    size : float
        Typical departure where the signature lives, in units of the noise.
    gain : float
        Nats by which the family's best fit beats the model without it.
    coefficients : of the family's fields
    """

    channel: str
    name: str
    words: str
    frame: str
    z: float
    size: float
    tolerance: float
    gain: float
    coefficients: Field
    family: Family | None = None
    detail: str = ""

    @property
    def matters(self) -> bool:
        """Whether it is large enough to be called a mismatch."""
        return self.size > self.tolerance


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Screening:
    """All findings, strongest first, and the strength that chance reaches once in a thousand."""

    findings: tuple[Finding, ...]
    threshold: float

    def significant(self) -> list[Finding]:
        """Return the findings beyond chance and tolerance."""
        return [f for f in self.findings if f.z > self.threshold and f.matters]


def screen_mean(
    patches: Sequence[Patch],
    states: Sequence[Whitened],
    families: Sequence[Family],
    noise: NoiseModel,
    rng: np.random.Generator,
    *,
    draws: int = DRAWS,
) -> Screening:
    """Test every family, and the rows' offsets and slips."""
    recordings = sorted({p.recording for p in patches})
    own = {r: [k for k, p in enumerate(patches) if p.recording == r] for r in recordings}
    picks = [s.used & p.fit for p, s in zip(patches, states, strict=True)]
    basis = {
        r: _orthonormal(np.concatenate([states[k].columns[picks[k]] for k in own[r]]))
        for r in recordings
    }
    real, fields = _innovations(patches, states, picks, noise, rng, draws)
    matrix = {r: np.concatenate([fields[k] for k in own[r]]).astype(np.float32) for r in recordings}
    actual = {r: np.concatenate([real[k] for k in own[r]]).astype(np.float32) for r in recordings}
    rows: list[tuple[str, str, str, Field, Field, Field, Family]] = []
    for family in families:
        projected = _projected(family, patches, states, picks, own, basis)
        if projected is None:
            continue
        blocks, raw = projected
        gram = sum(b.T @ b for b in blocks.values())
        solver, dof = _inverse(np.asarray(gram, dtype=np.float64), raw)
        if dof == 0:
            continue
        c_real = sum(b.T @ actual[r] for r, b in blocks.items())
        c_null = sum(b.T @ matrix[r] for r, b in blocks.items())
        t_real = float(c_real @ solver @ c_real)
        t_null = np.einsum("kd,kl,ld->d", c_null, solver, c_null)
        rows.append(
            (
                family.name, family.words, family.frame, np.array([t_real, dof]), t_null,
                solver @ c_real, family,
            )
        )  # fmt: skip
    findings: list[Finding] = []
    maxima = np.full(draws, -np.inf)
    for name, words, frame, (t_real, dof), t_null, beta, family in rows:
        scale = max(float(t_null.mean()) / dof, 1.0)
        z_null = as_deviate(t_null / scale, dof)
        maxima = np.maximum(maxima, z_null)
        z = float(as_deviate(np.array([t_real / scale]), dof)[0])
        size, edgy = _size(family, patches, states, picks, beta, t_real / scale, dof)
        findings.append(
            Finding(
                channel="mean", name=name, words=words, frame=frame, z=z, size=size,
                tolerance=EDGE_TOLERANCE if edgy else TOLERANCE,
                gain=0.5 * (t_real / scale - dof), coefficients=beta, family=family,
            )
        )  # fmt: skip
    for recording in recordings:
        tests = RowTests.build(
            [patches[k] for k in own[recording]], [states[k] for k in own[recording]],
            [picks[k] for k in own[recording]], basis[recording],
        )  # fmt: skip
        result, null = tests.run(actual[recording], matrix[recording])
        maxima = np.maximum(maxima, null)
        for row in result:
            findings.append(
                Finding(
                    channel="mean", name=f"free:{row.name}:{recording}", words=row.words,
                    frame=row.frame, z=row.z, size=row.size, tolerance=TOLERANCE, gain=row.gain,
                    coefficients=row.coefficients, detail=row.detail,
                )
            )  # fmt: skip
    drawn = _by_patch(patches, picks, own, matrix)
    wave = strongest_wave(patches, states, picks, drawn)
    if wave is not None:
        maxima = np.maximum(maxima, wave.null)
        sd = float(
            np.median(np.concatenate([s.sd_mm[p] for s, p in zip(states, picks, strict=True)]))
        )
        findings.append(
            Finding(
                channel="mean", name="free:range_period", words="range from the sensor",
                frame="sensor", z=wave.z, size=wave.amplitude_mm / sd, tolerance=TOLERANCE,
                gain=wave.gain, coefficients=np.array([wave.period_mm, wave.amplitude_mm]),
                detail=f"periodic over the range, about every {1e3 * wave.period_mm:.3g} µm",
            )
        )  # fmt: skip
    column, null = _columns(patches, states, picks, drawn)
    maxima = np.maximum(maxima, null)
    findings.append(column)
    threshold = tail_threshold(maxima, max(len(findings), 1))
    return Screening(findings=tuple(sorted(findings, key=lambda f: -f.z)), threshold=threshold)


def _by_patch(
    patches: Sequence[Patch],
    picks: Sequence[Mask],
    own: dict[int, list[int]],
    matrix: dict[int, Field],
) -> list[Field]:
    """Split the recordings' drawn nulls into those of their patches."""
    drawn: list[Field] = [np.zeros(0)] * len(patches)
    for recording, members in own.items():
        ends = np.cumsum([0, *(int(picks[k].sum()) for k in members)])
        for k, a, b in zip(members, ends[:-1], ends[1:], strict=True):
            drawn[k] = matrix[recording][a:b]
    return drawn


def _columns(
    patches: Sequence[Patch],
    states: Sequence[Whitened],
    picks: Sequence[Mask],
    drawn: Sequence[Field],
) -> tuple[Finding, Field]:
    """Test fixed offsets of the columns, shared by all recordings."""
    real = column_equations(patches, states, picks)
    t, dof = real.chi_square()
    t_null, _ = column_equations(patches, states, picks, drawn).chi_square()
    scale = max(float(t_null.mean()) / dof, 1.0)
    # the sum over many columns: its own scatter under the null, not only the chi-square's
    spread = max(float(t_null.std() / scale) / np.sqrt(2 * dof), 1.0)
    z_null = as_deviate(dof + (t_null / scale - dof) / spread, dof)
    z = float(as_deviate(np.array([dof + (float(t) / scale - dof) / spread]), dof)[0])
    offsets, gain = real.offsets()
    sd = float(np.median(np.concatenate([s.sd_mm[p] for s, p in zip(states, picks, strict=True)])))
    return (
        Finding(
            channel="mean", name="free:column", words="column of the profile", frame="sensor", z=z,
            size=float(np.std(offsets)) / sd, tolerance=TOLERANCE, gain=max(gain, 0.0),
            coefficients=offsets, detail="fixed offsets of single columns",
        ),
        z_null,
    )  # fmt: skip


def as_deviate(chi_square: Field, dof: float) -> Field:
    """Gaussian deviate of the same upper tail as a chi-square statistic."""
    log_tail = stats.chi2.logsf(chi_square, dof)
    far = log_tail < -600
    z = stats.norm.isf(np.exp(np.where(far, -600, log_tail)))
    return np.asarray(np.where(far, np.sqrt(np.maximum(-2 * log_tail, 0)), np.clip(z, -8, None)))


def tail_threshold(maxima: Field, statistics: int) -> float:
    """Strength that the null's maximum exceeds once in a thousand; at least Bonferroni's."""
    finite = maxima[np.isfinite(maxima)]
    bonferroni = float(stats.norm.isf(LEVEL / statistics))
    if finite.size < 10:
        return bonferroni
    scale = max(float(np.std(finite)) * np.sqrt(6) / np.pi, 0.15)
    middle = float(np.mean(finite)) - 0.5772 * scale
    return float(max(bonferroni, middle - scale * float(np.log(-np.log1p(-LEVEL)))))


def _innovations(
    patches: Sequence[Patch],
    states: Sequence[Whitened],
    picks: Sequence[Mask],
    noise: NoiseModel,
    rng: np.random.Generator,
    draws: int,
) -> tuple[list[Field], list[Field]]:
    """Whitened residuals at the picked readings (N,), and of drawn nulls (N, draws)."""
    real, null = [], []
    for patch, state, pick in zip(patches, states, picks, strict=True):
        real.append(np.clip(state.innovations[pick], -CLIP, CLIP))
        step = patch.view.datasheet.step_mm
        drawn = np.empty((int(pick.sum()), draws), dtype=np.float32)
        for d in range(draws):
            field = noise.draw(patch.shape, rng) * state.sd_mm
            if step:
                # rounding at a random phase: what the mean is worth in steps doesn't matter
                field = np.rint((field + patch.plain_mm) / step) * step - patch.plain_mm
            filled = np.where(state.used, np.nan_to_num(field) / state.sd_mm, 0.0)
            drawn[:, d] = np.clip(state.whitener.apply(filled)[pick], -CLIP, CLIP)
        null.append(drawn)
    return real, null


def _orthonormal(columns: Field) -> Field:
    """Orthonormal basis of the placement's columns, without directions that nothing shows."""
    values, vectors = np.linalg.eigh(columns.T @ columns)
    kept = values > 1e-6 * max(values.max(), 1e-30)
    return np.asarray(columns @ (vectors[:, kept] / np.sqrt(values[kept])), dtype=np.float32)


def _projected(
    family: Family,
    patches: Sequence[Patch],
    states: Sequence[Whitened],
    picks: Sequence[Mask],
    own: dict[int, list[int]],
    basis: dict[int, Field],
) -> tuple[dict[int, Field], Field] | None:
    """Whitened fields of a family orthogonal to the placement, and their squares before that."""
    blocks: dict[int, Field] = {}
    raw: Field | float = 0.0
    for recording, members in own.items():
        if any(family.fields[k] is None for k in members):
            continue
        parts = []
        for k in members:
            fields = family.fields[k]
            assert fields is not None
            parts.append(
                np.stack([states[k].whiten(f)[picks[k]] for f in fields], axis=1).astype(np.float32)
            )
        stacked = np.concatenate(parts)
        raw = raw + (stacked.astype(np.float64) ** 2).sum(axis=0)
        q = basis[recording]
        blocks[recording] = stacked - q @ (q.T @ stacked)
    if not blocks or not np.any(raw):
        return None
    return blocks, np.asarray(raw)


def _inverse(gram: Field, raw: Field) -> tuple[Field, int]:
    """Pseudo-inverse over directions that the placement leaves visible, and how many they are."""
    scale = np.sqrt(np.maximum(raw, 1e-30))
    values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
    kept = values > 1e-3
    half = vectors[:, kept] / np.sqrt(values[kept]) / scale[:, None]
    return half @ half.T, int(kept.sum())


def _size(
    family: Family,
    patches: Sequence[Patch],
    states: Sequence[Whitened],
    picks: Sequence[Mask],
    beta: Field,
    statistic: float,
    dof: float,
) -> tuple[float, bool]:
    """Typical departure where a signature lives, in units of the noise; whether at edges."""
    fourth = square = at_edges = 0.0
    for fields, patch, state, pick in zip(family.fields, patches, states, picks, strict=True):
        if fields is None:
            continue
        fitted = (np.tensordot(beta, fields, axes=1) / state.sd_mm)[pick]
        columns = (patch.columns / state.sd_mm[..., None])[pick]
        step = max(1, len(columns) // 4000)
        few, some = columns[::step], fitted[::step]
        ridge = 1e-9 * np.trace(few.T @ few) * np.eye(few.shape[1])
        free = fitted - columns @ np.linalg.solve(few.T @ few + ridge, few.T @ some)
        fourth += float((free**4).sum())
        square += float((free**2).sum())
        at_edges += float((free[patch.edge[pick]] ** 2).sum())
    if square == 0:
        return 0.0, False
    shrunk = np.sqrt(max(0.0, 1 - dof / max(statistic, 1e-9)))
    return float(np.sqrt(fourth / square) * shrunk), at_edges > 0.7 * square
