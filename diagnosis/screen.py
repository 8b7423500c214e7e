"""Detection in the mean: every family of signatures against the noise, the pose projected out.

Statistics are sums of squares of whitened residuals along a family's fields, orthogonal to the
placement's columns (Frisch and Waugh 1933). Their null is drawn: fields with the calibrated
spectrum, the real pattern of missing readings and the same rounding, the same processing, the
maximum over all statistics; its tail is continued by a Gumbel law where draws are few.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.columnwise import column_equations
from diagnosis.edges import READ_AT_EDGES
from diagnosis.families import Family
from diagnosis.finding import Finding, Screening, as_deviate, tail_threshold
from diagnosis.noise import Field, Mask, NoiseModel
from diagnosis.patch import Patch
from diagnosis.rangewise import strongest_wave
from diagnosis.rowwise import RowTests
from diagnosis.score import CLIP, Whitened
from sensors.effects.base import Effect
from sensors.effects.edge_mixing import EdgeMixing
from sensors.effects.finite_spot import FiniteSpot

DRAWS = 48
TOLERANCE = 0.07
"""A departure of the mean below this share of the noise is no mismatch, however significant.

A calibrated instrument isn't better: of 120 sealed nulls one was 0.068 off.
"""
ROW_TOLERANCE = 0.13
"""The same for single profiles; one of 360 opened nulls was 0.125 off."""
EDGE_TOLERANCE = 0.6
"""The same where a signature lives on depth edges, which no mesh and no pose place exactly."""
LISTED_TOLERANCE = 0.25
"""The same where the sensor's file lists what edges do: rms over all edges, along the signature.

A maker's few numbers follow no optics closely: of sixty sealed nulls the edges of one were 0.21 off
along a narrower line.
"""
WIDER_TOLERANCE = 0.2
"""The same for two levels mixed by a wider line than is listed; opened nulls had 0.19 at most."""
BEAM_TOLERANCE = 0.15
"""The same for a line that is wider by now; eleven opened nulls had 0.07 at most."""
WHOLE_TOLERANCE = 1.25
"""The same for the rms of all edges in any direction; one of those nulls had 1.11."""
TOGETHER = 4.0
"""Readings on depth edges and in corners that err together: so many count as one."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Readings:
    """Whitened readings of all recordings, real and drawn, with the placement's span.

    Attributes
    ----------
    patches, states : where they come from
    picks : for each patch (n, m) bool
    own : patches of each recording
    basis : for each recording (N, k), orthonormal columns of its placement
    real, drawn : for each patch (N,) and (N, draws)
    """

    patches: Sequence[Patch]
    states: Sequence[Whitened]
    picks: Sequence[Mask]
    own: dict[int, list[int]]
    basis: dict[int, Field]
    real: Sequence[Field]
    drawn: Sequence[Field]

    @classmethod
    def build(
        cls,
        patches: Sequence[Patch],
        states: Sequence[Whitened],
        noise: NoiseModel,
        rng: np.random.Generator,
        draws: int,
    ) -> "Readings":
        """Draw the null for all readings that may be fitted."""
        picks = [s.used & p.fit for p, s in zip(patches, states, strict=True)]
        real, drawn = _innovations(patches, states, picks, noise, rng, draws)
        recordings = sorted({p.recording for p in patches})
        own = {r: [k for k, p in enumerate(patches) if p.recording == r] for r in recordings}
        bare = cls(
            patches=patches, states=states, picks=picks, own=own, basis={}, real=real, drawn=drawn
        )
        return bare._based()

    def away_from_edges(self) -> "Readings":
        """Return the readings that no depth edge reaches."""
        kept = [~p.edge[k] for p, k in zip(self.patches, self.picks, strict=True)]
        return replace(
            self,
            picks=[k & ~p.edge for p, k in zip(self.patches, self.picks, strict=True)],
            real=[v[k] for v, k in zip(self.real, kept, strict=True)],
            drawn=[v[k] for v, k in zip(self.drawn, kept, strict=True)],
        )._based()

    def _based(self) -> "Readings":
        return replace(
            self,
            basis={
                r: _orthonormal(
                    np.concatenate([self.states[k].columns[self.picks[k]] for k in members])
                )
                for r, members in self.own.items()
            },
        )

    def of(self, recording: int) -> tuple[Field, Field]:
        """Real (N,) and drawn (N, draws) readings of one recording."""
        members = self.own[recording]
        return (
            np.concatenate([self.real[k] for k in members]),
            np.concatenate([self.drawn[k] for k in members]),
        )

    def edges(self) -> tuple[int, float]:
        """Return how many readings a depth edge reaches, and their rms beyond the drawn nulls'."""
        at_edges = [p.edge[k] for p, k in zip(self.patches, self.picks, strict=True)]
        squares = [
            np.concatenate([np.square(v[e]).ravel() for v, e in zip(some, at_edges, strict=True)])
            for some in (self.real, self.drawn)
        ]
        if not squares[0].size:
            return 0, 0.0
        beyond = max(squares[0].mean() - squares[1].mean(), 0.0)
        return squares[0].size, float(np.sqrt(beyond))

    def projected(self, family: Family) -> tuple[dict[int, Field], Field] | None:
        """Whitened fields of a family orthogonal to the placement, and their squares before."""
        blocks: dict[int, Field] = {}
        raw: Field | float = 0.0
        for recording, members in self.own.items():
            if any(family.fields[k] is None for k in members):
                continue
            parts = []
            for k in members:
                fields = family.fields[k]
                assert fields is not None
                white = [self.states[k].whiten(f)[self.picks[k]] for f in fields]
                parts.append(np.stack(white, axis=1).astype(np.float32))
            stacked = np.concatenate(parts)
            raw = raw + (stacked.astype(np.float64) ** 2).sum(axis=0)
            q = self.basis[recording]
            blocks[recording] = stacked - q @ (q.T @ stacked)
        if not blocks or not np.any(raw):
            return None
        return blocks, np.asarray(raw)


def screen_mean(
    patches: Sequence[Patch],
    states: Sequence[Whitened],
    families: Iterable[Family],
    noise: NoiseModel,
    rng: np.random.Generator,
    *,
    draws: int = DRAWS,
) -> Screening:
    """Test every family, and the rows' offsets and slips; bulk physics away from edges."""
    everywhere = Readings.build(patches, states, noise, rng, draws)
    away = everywhere.away_from_edges()
    findings: list[Finding] = []
    maxima = np.full(draws, -np.inf)
    edges = everywhere.edges() if lists_edges(patches[0]) else None
    for family in families:
        tested = _family(family, everywhere if family.at_edges else away, edges)
        if tested is not None:
            findings.append(tested[0])
            maxima = np.maximum(maxima, tested[1])
    for recording, members in away.own.items():
        tests = RowTests.build(
            [patches[k] for k in members], [states[k] for k in members],
            [away.picks[k] for k in members], away.basis[recording],
        )  # fmt: skip
        result, null = tests.run(*away.of(recording))
        maxima = np.maximum(maxima, null)
        for row in result:
            findings.append(
                Finding(
                    channel="mean", name=f"free:{row.name}:{recording}", words=row.words,
                    frame=row.frame, z=row.z, size=row.size, gain=row.gain,
                    tolerance=TOLERANCE if row.name.endswith("_period") else ROW_TOLERANCE,
                    coefficients=row.coefficients, detail=row.detail, period=row.period,
                )
            )  # fmt: skip
    wave = strongest_wave(patches, states, away.picks, away.drawn)
    if wave is not None:
        maxima = np.maximum(maxima, wave.null)
        findings.append(
            Finding(
                channel="mean", name="free:range_period", words="range from the sensor",
                frame="sensor", z=wave.z, size=wave.amplitude_mm / _typical_sd(away),
                tolerance=TOLERANCE, gain=wave.gain,
                coefficients=np.array([wave.period_mm, wave.amplitude_mm]),
                detail=f"periodic over the range, about every {1e3 * wave.period_mm:.3g} µm",
                period=(1e3 * wave.period_mm, "µm"),
            )
        )  # fmt: skip
    column, null = _columns(away)
    maxima = np.maximum(maxima, null)
    findings.append(column)
    threshold = tail_threshold(maxima, max(len(findings), 1))
    return Screening(findings=tuple(sorted(findings, key=lambda f: -f.z)), threshold=threshold)


def _family(
    family: Family, readings: Readings, edges: tuple[int, float] | None
) -> tuple[Finding, Field] | None:
    """Test one family; its finding and the deviates of the drawn nulls.

    Parameters
    ----------
    edges : from `Readings.edges`, where the sensor's file says what they do
    """
    projected = readings.projected(family)
    if projected is None:
        return None
    blocks, raw = projected
    gram = sum(b.T @ b for b in blocks.values())
    solver, dof = _inverse(np.asarray(gram, dtype=np.float64), raw)
    if dof == 0:
        return None
    both = {r: readings.of(r) for r in blocks}
    c_real = sum(b.T @ both[r][0] for r, b in blocks.items())
    c_null = sum(b.T @ both[r][1] for r, b in blocks.items())
    t_null = np.einsum("kd,kl,ld->d", c_null, solver, c_null)
    scale = max(float(t_null.mean()) / dof, 1.0)
    if family.at_corners:
        scale *= TOGETHER
    t = float(c_real @ solver @ c_real) / scale
    beta = solver @ c_real
    if family.effect is not None and family.at_edges and edges is not None:
        count, whole = edges
        size = math.sqrt(max(t - dof, 0.0) / max(count, 1))
        tolerance = _listed_tolerance(family.effect, readings.patches[0])
        if whole > WHOLE_TOLERANCE:
            size, tolerance = whole, WHOLE_TOLERANCE
    else:
        size = _size(family, readings, beta, t, dof)
        tolerance = EDGE_TOLERANCE if family.at_edges else TOLERANCE
    finding = Finding(
        channel="mean", name=family.name, words=family.words, frame=family.frame,
        z=float(as_deviate(np.array([t]), dof)[0]), size=size, tolerance=tolerance,
        gain=0.5 * (t - dof), coefficients=beta, family=replace(family, fields=()),
    )  # fmt: skip
    return finding, as_deviate(t_null / scale, dof)


def lists_edges(patch: Patch) -> bool:
    """Whether the sensor's file says what depth edges do to a reading."""
    return any(e.covariate in READ_AT_EDGES for e in patch.view.sensor.effects)


def _listed_tolerance(effect: Effect, patch: Patch) -> float:
    """Size that a signature on edges may have by the faults of what the sensor's file lists."""
    if isinstance(effect, FiniteSpot) and effect.beam_um > 0:
        return BEAM_TOLERANCE
    mixing = [e for e in patch.view.sensor.effects if isinstance(e, EdgeMixing)]
    if mixing and isinstance(effect, EdgeMixing):
        wider = (effect.line_sd_um or 0.0) > (mixing[0].line_sd_um or 0.0)
        return WIDER_TOLERANCE if wider else LISTED_TOLERANCE
    return LISTED_TOLERANCE


def _typical_sd(readings: Readings) -> float:
    """Median size of the noise at the readings, mm."""
    return float(
        np.median(
            np.concatenate(
                [s.sd_mm[p] for s, p in zip(readings.states, readings.picks, strict=True)]
            )
        )
    )


def _columns(readings: Readings) -> tuple[Finding, Field]:
    """Test fixed offsets of the columns, shared by all recordings."""
    patches, states, picks = readings.patches, readings.states, readings.picks
    real = column_equations(patches, states, picks)
    t, dof = real.chi_square()
    t_null, _ = column_equations(patches, states, picks, readings.drawn).chi_square()
    scale = max(float(t_null.mean()) / dof, 1.0)
    # the sum over many columns: its own scatter under the null, not only the chi-square's
    spread = max(float(t_null.std() / scale) / np.sqrt(2 * dof), 1.0)
    z_null = as_deviate(dof + (t_null / scale - dof) / spread, dof)
    z = float(as_deviate(np.array([dof + (float(t) / scale - dof) / spread]), dof)[0])
    offsets, gain, _ = real.shrunk()
    return (
        Finding(
            channel="mean", name="free:column", words="column of the profile", frame="sensor", z=z,
            size=float(np.std(offsets)) / _typical_sd(readings), tolerance=TOLERANCE,
            gain=max(gain, 0.0), coefficients=offsets, detail="fixed offsets of single columns",
        ),
        z_null,
    )  # fmt: skip


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


def _inverse(gram: Field, raw: Field) -> tuple[Field, int]:
    """Pseudo-inverse over directions that the placement leaves visible, and how many they are."""
    scale = np.sqrt(np.maximum(raw, 1e-30))
    values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
    kept = values > 1e-3
    half = vectors[:, kept] / np.sqrt(values[kept]) / scale[:, None]
    return half @ half.T, int(kept.sum())


def _size(family: Family, readings: Readings, beta: Field, statistic: float, dof: int) -> float:
    """Typical departure where a signature lives, beyond the placement, in units of the noise."""
    fourth = square = 0.0
    for fields, patch, state, pick in zip(
        family.fields, readings.patches, readings.states, readings.picks, strict=True
    ):
        if fields is None or not pick.any():
            continue
        sd = state.sd_mm[pick]
        fitted = sum(b * f[pick] for b, f in zip(beta, fields, strict=True)) / sd
        columns = patch.columns[pick] / sd[:, None]
        step = max(1, len(columns) // 4000)
        few, some = columns[::step], fitted[::step]
        ridge = 1e-9 * np.trace(few.T @ few) * np.eye(few.shape[1])
        free = fitted - columns @ np.linalg.solve(few.T @ few + ridge, few.T @ some)
        fourth += float((free**4).sum())
        square += float((free**2).sum())
    if square == 0:
        return 0.0
    shrunk = np.sqrt(max(0.0, 1 - dof / max(statistic, 1e-9)))
    return float(np.sqrt(fourth / square) * shrunk)
