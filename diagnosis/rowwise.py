"""Whole profiles: offsets and slips of each row, smooth or periodic in time.

What the motion does moves whole rows: an offset of the row in depth (a vibration, a drift) or a
slip along the travel, which shows in proportion to the slope (a ripple, lost encoder counts).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

from diagnosis.noise import Field, Mask
from diagnosis.patch import Patch
from diagnosis.score import CLIP, Whitened

COMB = 4
KNOTS = 12
PEAK = 2.0
"""Largest departure of a smooth curve over its rms."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class RowFinding:
    """One statistic on rows; see `screen.Finding`."""

    name: str
    words: str
    frame: str
    z: float
    size: float
    gain: float
    coefficients: Field
    detail: str
    period: tuple[float, str] | None = None


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class RowTests:
    """Row sums of one recording, ready for any pattern over its rows.

    Attributes
    ----------
    kinds : names of what moves: "row_offset", "row_slip"
    sums : for each kind, (rows, N) sparse-like product: row sums of weights times innovations
    gram : for each kind (rows, rows), the pose projected out
    time_s : (rows,)
    strength : for each kind, a typical reading's change in deviations for a unit of it
    typical : for each kind, rms change of the readings in deviations for each root of chi-square
    """

    kinds: tuple[str, ...]
    weights: tuple[list[tuple[Field, Field]], ...]
    gram: tuple[Field, ...]
    overlap: tuple[Field, ...]
    basis: Field
    time_s: Field
    strength: tuple[float, ...]
    typical: tuple[float, ...]
    period_rows: Field

    @classmethod
    def build(
        cls,
        patches: Sequence[Patch],
        states: Sequence[Whitened],
        picks: Sequence[Mask],
        basis: Field,
        kinds: Sequence[str] = ("row_offset", "row_slip"),
    ) -> "RowTests":
        """Whiten every row's indicator: rows COMB apart don't touch and share one field."""
        time = np.concatenate([p.view.time_s for p in patches])
        names, weights, grams, overlaps, strengths, typicals = [], [], [], [], [], []
        for kind in kinds:
            entries: list[tuple[Field, Field]] = []
            gram = np.zeros((time.size, time.size))
            start = 0
            level = []
            for patch, state, pick in zip(patches, states, picks, strict=True):
                n = patch.shape[0]
                lever = np.ones(patch.shape)
                if kind == "row_slip":
                    lever = np.clip(np.nan_to_num(patch.view.slope_y), -3, 3)
                level.append(np.abs(lever / state.sd_mm)[pick])
                combs = []
                for phase in range(COMB):
                    teeth = np.arange(n) % COMB == phase
                    combs.append(np.where(pick, state.whiten(lever * teeth[:, None]), 0.0))
                rows, columns = np.nonzero(pick)
                values = np.stack([c[rows, columns] for c in combs], axis=1)
                owner = rows[:, None] - (rows[:, None] - np.arange(COMB)[None]) % COMB
                values[owner < 0] = 0.0
                owner = np.where(owner < 0, 0, owner)
                for a in range(COMB):
                    for b in range(COMB):
                        np.add.at(
                            gram,
                            (start + owner[:, a], start + owner[:, b]),
                            values[:, a] * values[:, b],
                        )
                entries.append((start + owner, values))
                start += n
            owners = np.concatenate([e[0] for e in entries])
            value = np.concatenate([e[1] for e in entries])
            overlap = weights_matrix(owners, value, time.size) @ basis
            names.append(kind)
            weights.append([(owners, value)])
            grams.append(gram - overlap @ overlap.T)
            overlaps.append(overlap)
            typical = np.concatenate(level)
            # a few steep readings don't make a typical one
            strengths.append(float(np.mean(typical)) if typical.size else 0.0)
            raw, white = float((typical**2).sum()), float(np.trace(gram))
            typicals.append(np.sqrt(raw / max(white, 1e-30) / max(typical.size, 1)))
        return cls(
            kinds=tuple(names),
            weights=tuple(weights),
            gram=tuple(grams),
            overlap=tuple(overlaps),
            basis=basis,
            time_s=time,
            strength=tuple(strengths),
            typical=tuple(typicals),
            period_rows=np.arange(time.size, dtype=np.float64),
        )

    def sums(self, kind: int, innovations: Field) -> Field:
        """Row sums (rows,) or (rows, draws), the pose projected out."""
        owners, value = self.weights[kind][0]
        two = innovations.reshape(len(innovations), -1)
        plain = weights_matrix(owners, value, self.time_s.size) @ two
        plain -= self.overlap[kind] @ (self.basis.T @ two)
        return np.asarray(plain.reshape(self.time_s.size, *innovations.shape[1:]))

    def run(self, actual: Field, null: Field) -> tuple[list[RowFinding], Field]:
        """Test smooth and periodic patterns; return findings and the nulls' largest deviate."""
        findings: list[RowFinding] = []
        largest = np.full(null.shape[1], -np.inf)
        for kind, name in enumerate(self.kinds):
            real, drawn = self.sums(kind, actual), self.sums(kind, null)
            gram = self.gram[kind]
            if np.trace(gram) <= 1e-9 * max(self.strength[kind] ** 2, 1e-30):
                continue
            what = "offset of whole profiles" if kind == 0 else "slip along the travel"
            smooth = row_hats(self.time_s, min(KNOTS, self.time_s.size // 4))
            tested = _test(smooth, gram, real, drawn)
            if tested is not None:
                z, t, beta, dof, z_null = tested
                largest = np.maximum(largest, z_null)
                findings.append(
                    RowFinding(
                        name=name, words="time since the first profile", frame="time", z=z,
                        size=PEAK * self.typical[kind] * float(np.sqrt(max(t - dof, 0.0))),
                        gain=0.5 * (t - dof), coefficients=smooth @ beta,
                        detail=f"{what}, slowly varying",
                    )
                )  # fmt: skip
            best = self._periodic(kind, real, drawn, what)
            if best is not None:
                finding, z_null = best
                findings.append(finding)
                largest = np.maximum(largest, z_null)
        return findings, largest

    def waves(self, kind: int) -> "Waves | None":
        """Frequencies half a resolution element apart, from 1.5 cycles in the scan to Nyquist's."""
        step = float(np.median(np.diff(self.time_s)))
        if step <= 0 or self.time_s.size < 24:
            return None
        span = self.time_s[-1] - self.time_s[0]
        count = int(min(span / step, 3000))
        frequencies = np.arange(3, count + 1) / (2 * count * step)
        gram = self.gram[kind]
        wave = 2 * np.pi * np.outer(self.time_s, frequencies)
        cosine, sine = np.cos(wave), np.sin(wave)
        a, b = ((w * (gram @ w)).sum(axis=0) for w in (cosine, sine))
        c = (cosine * (gram @ sine)).sum(axis=0)
        ridge = 1e-3 * float(np.median(a + b))
        return Waves(
            frequencies=frequencies, cosine=cosine, sine=sine, a=a + ridge, b=b + ridge, c=c
        )

    def _periodic(
        self, kind: int, real: Field, drawn: Field, what: str
    ) -> tuple[RowFinding, Field] | None:
        waves = self.waves(kind)
        if waves is None:
            return None
        p_real, p_null = waves.power(real), waves.power(drawn)
        level = np.maximum(_running_mean(p_null.mean(axis=1) / 2, 9), 1.0)
        z_real = _pairs(p_real / level)
        z_null = _pairs(p_null / level[:, None]).max(axis=0)
        k = int(np.argmax(z_real))
        amplitude = waves.amplitude(k, real)
        rate = float(waves.frequencies[k])
        step = float(np.median(np.diff(self.time_s)))
        return (
            RowFinding(
                name=f"{self.kinds[kind]}_period",
                words="time since the first profile",
                frame="time",
                z=float(z_real[k]), size=float(amplitude * self.strength[kind]),
                gain=0.5 * (float(p_real[k]) - 2), coefficients=np.array([rate, amplitude]),
                detail=f"{what}, periodic at {rate:.4g} Hz, every {1 / (rate * step):.3g} profiles",
                period=(1 / rate, "s"),
            ),
            z_null,
        )  # fmt: skip


def row_powers(
    patches: Sequence[Patch], states: Sequence[Whitened], kind: str
) -> list[tuple[float, float]]:
    """Power of the rows' offsets or slips at each frequency of one recording, (Hz, chi-square)."""
    picks = [s.used & p.fit for p, s in zip(patches, states, strict=True)]
    columns = np.concatenate([s.columns[k] for s, k in zip(states, picks, strict=True)])
    values, vectors = np.linalg.eigh(columns.T @ columns)
    kept = values > 1e-6 * max(values.max(), 1e-30)
    basis = columns @ (vectors[:, kept] / np.sqrt(values[kept]))
    tests = RowTests.build(patches, states, picks, basis, kinds=(kind,))
    actual = np.concatenate(
        [np.clip(s.innovations[k], -CLIP, CLIP) for s, k in zip(states, picks, strict=True)]
    )
    waves = tests.waves(0)
    if waves is None:
        return []
    power = waves.power(tests.sums(0, actual))
    return list(zip(waves.frequencies.tolist(), power.tolist(), strict=True))


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Waves:
    """Sine and cosine over the rows at each frequency, with their products under the noise."""

    frequencies: Field
    cosine: Field
    sine: Field
    a: Field
    b: Field
    c: Field

    def power(self, sums: Field) -> Field:
        """Chi-square of the best sine at each frequency, (f,) or (f, draws)."""
        u, v = self.cosine.T @ sums, self.sine.T @ sums
        shape = (slice(None),) + (None,) * (sums.ndim - 1)
        a, b, c = self.a[shape], self.b[shape], self.c[shape]
        det = np.broadcast_to(a * b - c**2, u.shape)
        power = b * u**2 - 2 * c * u * v + a * v**2
        # a wave that a placement makes all of has none
        return np.asarray(np.divide(power, det, out=np.zeros_like(power), where=det > 0))

    def amplitude(self, k: int, sums: Field) -> float:
        """Size of the best sine at frequency k."""
        u, v = float(self.cosine[:, k] @ sums), float(self.sine[:, k] @ sums)
        det = self.a[k] * self.b[k] - self.c[k] ** 2
        return float(
            np.hypot((self.b[k] * u - self.c[k] * v) / det, (self.a[k] * v - self.c[k] * u) / det)
        )


def row_hats(time_s: Field, count: int) -> Field:
    """Hat functions over time, (rows, count)."""
    knots = np.linspace(time_s[0], time_s[-1], max(count, 2))
    return np.stack([np.interp(time_s, knots, row) for row in np.eye(knots.size)], axis=1)


def _test(
    pattern: Field, gram: Field, real: Field, drawn: Field
) -> tuple[float, float, Field, int, Field] | None:
    """Test a pattern over the rows; None where a placement makes all of it, as in few profiles."""
    from diagnosis.finding import as_deviate

    inner = pattern.T @ gram @ pattern
    values, vectors = np.linalg.eigh(inner)
    kept = values > max(1e-3 * values.max(), 1e-9 * float(np.trace(gram)))
    if not kept.any():
        return None
    solver = (vectors[:, kept] / values[kept]) @ vectors[:, kept].T
    dof = int(kept.sum())
    c_real, c_null = pattern.T @ real, pattern.T @ drawn
    t_null = np.einsum("kd,kl,ld->d", c_null, solver, c_null)
    scale = max(float(t_null.mean()) / dof, 1.0)
    t = float(c_real @ solver @ c_real) / scale
    return (
        float(as_deviate(np.array([t]), dof)[0]),
        t,
        solver @ c_real,
        dof,
        as_deviate(t_null / scale, dof),
    )


def _pairs(chi_square: Field) -> Field:
    """Deviate of a chi-square of two degrees of freedom."""
    tail = np.exp(-np.minimum(chi_square, 1200) / 2)
    return np.asarray(np.where(chi_square < 1200, stats.norm.isf(tail), np.sqrt(chi_square)))


def _running_mean(values: Field, width: int) -> Field:
    from scipy.ndimage import uniform_filter1d

    return np.asarray(uniform_filter1d(values, width, mode="nearest"))


def weights_matrix(owners: Field, values: Field, rows: int) -> Any:
    """Sparse (rows, N): each innovation's weight in the sums of the rows it touches."""
    from scipy.sparse import csr_matrix

    count, reach = owners.shape
    columns = np.repeat(np.arange(count), reach)
    return csr_matrix((values.ravel(), (owners.ravel(), columns)), shape=(rows, count))
