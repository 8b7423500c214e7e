"""Whitening: each reading given the neighbours measured before it.

The correlated Gaussian density of a scan is written as a product of conditionals, each given a
few earlier neighbours (Vecchia 1988, J. R. Stat. Soc. B 50, 297). The conditional's innovation is
a whitened reading; missing neighbours only change the weights, so edges and gaps need no filling.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import sparse

from diagnosis.fields import Field, Mask, Single
from diagnosis.noise.noise_model import NoiseModel
from sensors.view.view_cache import ViewCache

Groups = NDArray[np.int64]
# earlier neighbours as (rows up, columns): the current profile's last three, then profiles before
NEIGHBOURS = np.array(
    [
        (0, -1), (0, -2), (0, -3),
        (-1, 0), (-1, -1), (-1, 1), (-1, -2), (-1, 2),
        (-2, 0), (-2, -1), (-2, 1), (-3, 0),
    ],
    dtype=np.int64,
)  # fmt: skip


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Whitener:
    """Turns a field into innovations of unit variance under the noise model.

    Attributes
    ----------
    used : (n, m) bool
        Readings that count; others neither score nor condition.
    pattern : (n, m) int32
        Which neighbours each reading has, as bits.
    weights : (4096, 12) float64; deviation : (4096,) float64
        Conditional weights and standard deviation (of unit-variance noise) for each pattern met.
    """

    used: Mask
    pattern: NDArray[np.int32]
    weights: Field
    deviation: Field

    @classmethod
    def build(cls, noise: NoiseModel, used: Mask) -> "Whitener":
        """Solve the conditionals for the patterns of neighbours that `used` shows."""
        pattern = _patterns(used)
        met = np.flatnonzero(np.bincount(pattern[used], minlength=1))
        solved = _SOLVED.get(noise, None, lambda: _Conditionals(noise))
        solved.solve(met)
        return cls(
            used=used, pattern=pattern, weights=solved.weights, deviation=solved.deviation
        )

    def apply(self, field: Field) -> Field:
        """Innovations of `field` (n, m) in units of the noise; 0 where not used."""
        return _apply(
            np.ascontiguousarray(field, dtype=np.float64),
            self.used,
            self.pattern,
            self.weights,
            self.deviation,
        )

    def columns(self, fields: Sequence[Field | Single], sd_mm: Field) -> NDArray[np.float32]:
        """Innovations (k, N) of fields in mm, where used; each broadcasts to (n, m)."""
        out = np.empty((len(fields), int(self.used.sum())), dtype=np.float32)
        scaled = np.empty(self.used.shape)
        for field, row in zip(fields, out, strict=True):
            wide = np.broadcast_to(np.asarray(field, dtype=np.float64), self.used.shape)
            _column(
                wide, sd_mm, scaled, self.used, self.pattern, self.weights, self.deviation, row
            )
        return out

    def stacked(self, fields: Field, sd_mm: Field) -> NDArray[np.float32]:
        """Innovations (n, m, k) of k fields in mm that lie side by side; 0 where not used."""
        return np.asarray(
            _stacked(fields, sd_mm, self.used, self.pattern, self.weights, self.deviation)
        )

    def indicators(self, field: Field, row: Groups, column: Groups) -> sparse.csr_matrix:
        """Innovations (N, groups) of a field that is there in one group of readings alone.

        Parameters
        ----------
        field : (n, m) in deviations of the noise
        row, column : (n,), (m,) whose sum is the number of a reading's group
        """
        count = int(self.used.sum())
        value, owner, start = _indicators(
            np.ascontiguousarray(field, dtype=np.float64), row, column, self.used, self.pattern,
            self.weights, self.deviation, count,
        )  # fmt: skip
        shape = count, int(row[-1] + column[-1]) + 1
        return sparse.csr_matrix((value, owner, start), shape=shape)

    def conditional_sd(self) -> Field:
        """Return the standard deviation of each innovation before scaling, (n, m)."""
        return np.asarray(self.deviation[self.pattern])


class _Conditionals:
    """Conditionals of one noise model for each pattern of neighbours, solved when first met."""

    def __init__(self, noise: NoiseModel) -> None:
        size = len(NEIGHBOURS)
        self.weights = np.zeros((1 << size, size))
        self.deviation = np.ones(1 << size)
        self._known = np.zeros(1 << size, dtype=bool)
        self._known[0] = True
        self._correlation = _between(noise, NEIGHBOURS[:, None] - NEIGHBOURS[None, :])
        self._towards = _between(noise, NEIGHBOURS)
        self._innovation_sd = noise.innovation_sd

    def solve(self, patterns: NDArray[np.int64]) -> None:
        """Add the patterns that aren't known yet."""
        for code in patterns[~self._known[patterns]]:
            have = (int(code) >> np.arange(len(NEIGHBOURS))) & 1 == 1
            known = self._correlation[np.ix_(have, have)] + 1e-6 * np.eye(int(have.sum()))
            solved = np.linalg.solve(known, self._towards[have])
            self.weights[code, have] = solved
            left = max(1 - solved @ self._towards[have], 1e-4)
            self.deviation[code] = np.sqrt(left) * self._innovation_sd
            self._known[code] = True


_SOLVED: ViewCache[_Conditionals] = ViewCache(1)


def _between(noise: NoiseModel, lag: NDArray[np.int64]) -> Field:
    ly, lx = noise.lags
    row, column = lag[..., 0], lag[..., 1]
    inside = (np.abs(row) <= ly) & (np.abs(column) <= lx)
    return np.where(
        inside, noise.acf[np.clip(row, -ly, ly) + ly, np.clip(column, -lx, lx) + lx], 0.0
    )


@njit(cache=True)
def _patterns(used: Mask) -> NDArray[np.int32]:
    n, m = used.shape
    out = np.zeros((n, m), dtype=np.int32)
    for i in range(n):
        for j in range(m):
            if not used[i, j]:
                continue
            code = 0
            for k in range(len(NEIGHBOURS)):
                a, b = i + NEIGHBOURS[k, 0], j + NEIGHBOURS[k, 1]
                if a >= 0 and 0 <= b < m and used[a, b]:
                    code |= 1 << k
            out[i, j] = code
    return out


@njit(cache=True)
def _apply(
    field: Field,
    used: Mask,
    pattern: NDArray[np.int32],
    weights: Field,
    deviation: Field,
) -> Field:
    n, m = field.shape
    out = np.zeros((n, m))
    row = np.empty(m)
    for i in range(n):
        _innovate(i, field, used, pattern, weights, deviation, row)
        for j in range(m):
            if used[i, j]:
                out[i, j] = row[j]
    return out


@njit(cache=True)
def _innovate(
    i: int,
    field: Field,
    used: Mask,
    pattern: NDArray[np.int32],
    weights: Field,
    deviation: Field,
    row: Field,
) -> None:
    """Fill `row` (m,) with the innovations of profile i where used.

    As if no neighbour were missing, which is fast; then anew where one is.
    """
    m, count = field.shape[1], len(NEIGHBOURS)
    whole = (1 << count) - 1
    row[:] = field[i]
    for k in range(count):
        a, shift, weight = i + NEIGHBOURS[k, 0], NEIGHBOURS[k, 1], weights[whole, k]
        if a >= 0:
            low, high = max(0, -shift), min(m, m - shift)
            ours, theirs = row[low:high], field[a, low + shift : high + shift]
            for j in range(len(ours)):
                ours[j] -= weight * theirs[j]
    for j in range(m):
        code = pattern[i, j]
        if used[i, j] and code != whole:
            value = field[i, j]
            for k in range(count):
                if code >> k & 1:
                    value -= weights[code, k] * field[i + NEIGHBOURS[k, 0], j + NEIGHBOURS[k, 1]]
            row[j] = value
        row[j] /= deviation[code]


@njit(cache=True)
def _column(
    field: Field,
    sd: Field,
    scaled: Field,
    used: Mask,
    pattern: NDArray[np.int32],
    weights: Field,
    deviation: Field,
    out: NDArray[np.float32],
) -> None:
    """Fill `out` (N,) with the innovations of a field; `scaled` (n, m) is room to work in."""
    n, m = used.shape
    for i in range(n):
        for j in range(m):
            value = field[i, j]
            scaled[i, j] = value / sd[i, j] if used[i, j] and not np.isnan(value) else 0.0
    at = 0
    row = np.empty(m)
    for i in range(n):
        _innovate(i, scaled, used, pattern, weights, deviation, row)
        for j in range(m):
            if used[i, j]:
                out[at] = row[j]
                at += 1


@njit(cache=True)
def _stacked(
    fields: Field,
    sd: Field,
    used: Mask,
    pattern: NDArray[np.int32],
    weights: Field,
    deviation: Field,
) -> NDArray[np.float32]:
    n, m, count = fields.shape
    out = np.zeros((n, m, count), dtype=np.float32)
    value = np.empty(count)
    for i in range(n):
        for j in range(m):
            if not used[i, j]:
                continue
            code = pattern[i, j]
            scale = 1.0 / sd[i, j]
            for c in range(count):
                value[c] = scale * fields[i, j, c]
            for k in range(len(NEIGHBOURS)):
                if code >> k & 1:
                    a, b = i + NEIGHBOURS[k, 0], j + NEIGHBOURS[k, 1]
                    scale = weights[code, k] / sd[a, b]
                    for c in range(count):
                        value[c] -= scale * fields[a, b, c]
            for c in range(count):
                out[i, j, c] = value[c] / deviation[code]
    return out


@njit(cache=True)
def _indicators(
    field: Field,
    row: Groups,
    column: Groups,
    used: Mask,
    pattern: NDArray[np.int32],
    weights: Field,
    deviation: Field,
    count: int,
) -> tuple[Field, NDArray[np.int32], NDArray[np.int32]]:
    """Rows of the sparse matrix: a reading's own group, and those of its neighbours."""
    most = len(NEIGHBOURS) + 1
    value, owner = np.empty(count * most), np.empty(count * most, dtype=np.int32)
    start = np.zeros(count + 1, dtype=np.int32)
    n, m = used.shape
    at, end = 0, 0
    for i in range(n):
        for j in range(m):
            if not used[i, j]:
                continue
            code, begin = pattern[i, j], end
            owner[end] = row[i] + column[j]
            value[end] = field[i, j] / deviation[code]
            end += 1
            for k in range(len(NEIGHBOURS)):
                if not code >> k & 1:
                    continue
                a, b = i + NEIGHBOURS[k, 0], j + NEIGHBOURS[k, 1]
                whose, place = row[a] + column[b], begin
                while place < end and owner[place] != whose:
                    place += 1
                if place == end:
                    owner[end], value[end] = whose, 0.0
                    end += 1
                value[place] -= weights[code, k] * field[a, b] / deviation[code]
            at += 1
            start[at] = end
    return value[:end].copy(), owner[:end].copy(), start


def transposed(whitener: Whitener, innovations: Field) -> Field:
    """Apply the transposed operator: field (n, m) whose product with b is W b · innovations."""
    return np.asarray(
        _transposed(
            innovations,
            whitener.used,
            whitener.pattern,
            whitener.weights,
            whitener.deviation,
        )
    )


@njit(cache=True)
def _transposed(
    innovations: Field,
    used: Mask,
    pattern: NDArray[np.int32],
    weights: Field,
    deviation: Field,
) -> Field:
    n, m = innovations.shape
    out = np.zeros((n, m))
    for i in range(n):
        for j in range(m):
            if not used[i, j]:
                continue
            code = pattern[i, j]
            value = innovations[i, j] / deviation[code]
            out[i, j] += value
            for k in range(len(NEIGHBOURS)):
                if code >> k & 1:
                    out[i + NEIGHBOURS[k, 0], j + NEIGHBOURS[k, 1]] -= weights[code, k] * value
    return out
