"""Candidates: how the columns of the equations may change, cause by cause.

A component whose values are free for each profile is a candidate in several ways: a band of one
frequency for causes that oscillate; free values or steps for what no cause claims.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.special import logsumexp

from diagnosis.components.component import Component, laws_stated, stated
from diagnosis.components.smooth import products
from diagnosis.evidence.block_diagonal import BlockDiagonal
from diagnosis.evidence.gram import Block, Gram
from diagnosis.evidence.posterior import Cavity, Term, Weights
from diagnosis.settings import SETTINGS
from sensors.effects.base import Effect

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Candidate:
    """One way in which readings may depart.

    Attributes
    ----------
    name : unique
    effect : the catalogued effect's name; "" for unknown physics
    component : whose columns they are; of no effect where they change as no cause does
    at : columns of the equations
    shapes : combinations of these columns, each a variant; None for the columns as they are
    labels : of the variants, a frequency or a place
    listed : how the sensor's file lists the effect, or laws of light at edges for one that is
        weighed there; "" for not at all. A good instrument departs from that law, and not from none
    at_edges : whether it is weighed on all readings, and not on those off edges alone
    by_law : how many of the variants, the last, are the law of its cause
    """

    name: str
    effect: str
    component: Component
    at: NDArray[np.int64]
    shapes: tuple[Weights | None, ...] = (None,)
    labels: tuple[float, ...] = (0.0,)
    at_edges: bool = False
    listed: str = ""
    by_law: int = 0

    @property
    def log_shares(self) -> Floats:
        """Log probability of each variant before any reading, (V,): the law's, and any other."""
        free, law = len(self.shapes) - self.by_law, self.by_law
        of_law = SETTINGS.by_law if law else 0.0
        shares = np.r_[np.full(free, (1 - of_law) / free), np.full(law, of_law / max(law, 1))]
        return np.asarray(np.log(shares))

    @property
    def tried(self) -> int:
        """Forms that were looked at to find the variants: periods are picked from many."""
        relaxed = self.component.relaxed
        picked = relaxed.periodic and not relaxed.each
        return max(SETTINGS.periods_tried, len(self.shapes)) if picked else len(self.shapes)

    @property
    def of_recordings(self) -> bool:
        """Whether each recording has its own coefficients."""
        return self.component.own or self.component.relaxed.each == "profile"

    @property
    def key(self) -> str:
        """Name under which the population of good instruments holds it."""
        return stated(self.name, self.listed)

    def unclaimed(self) -> "Candidate":
        """Return the same as unknown physics."""
        return replace(self, effect="", component=replace(self.component, effect=""))

    def term(self, variant: int) -> Term:
        """Return a variant as a term."""
        return Term(at=self.at, weights=self.shapes[variant])

    def log_factors(self, cavity: Cavity, sizes: Floats) -> tuple[Floats, Floats]:
        """Log Bayes factors, given the cavity of the columns as they are.

        Returns
        -------
        of each variant (V, S); the mean of all forms that were looked at (S,), each as probable as
        it is before: those that weren't picked show nothing, and pay for what they could have been
        """
        single = [w for w in self.shapes if isinstance(w, np.ndarray) and w.shape[1] == 1]
        if len(single) == self.tried:
            each = cavity.log_factors_of_each(np.hstack(single), sizes)
            return each, np.asarray(logsumexp(each + self.log_shares[:, None], axis=0))
        cavities = [cavity if w is None else cavity.combined(w) for w in self.shapes]
        each = np.stack([c.log_factors(sizes) for c in cavities])
        mean = logsumexp(each + self.log_shares[:, None], axis=0)
        if self.tried > len(each):
            idle = np.max([c.log_price(sizes) for c in cavities], axis=0)
            seen = len(each) / self.tried
            mean = np.logaddexp(mean + np.log(seen), idle + np.log1p(-seen))
        return each, np.asarray(mean)


def candidates_of(
    gram: Gram,
    times: dict[int, Floats],
    ways: dict[int, Floats],
    listed: Sequence[Effect],
    laws: Mapping[str, Sequence[Floats]],
) -> list[Candidate]:
    """List the candidates of all components.

    Parameters
    ----------
    laws : by component, its columns as the law of its cause combines them (`law_forms`)
    listed : effects that the sensor's file lists
    times, ways : time (s) and travel (mm) of each recording's profiles
    """
    names = {e.name for e in listed}
    at_edges = laws_stated(listed)
    by_name: dict[str, list[Block]] = {}
    for block in gram.blocks:
        by_name.setdefault(block.component.group, []).append(block)
    out = []
    for name, blocks in by_name.items():
        component = blocks[0].component
        at = np.concatenate([b.at for b in blocks])
        if component.relaxed.each == "profile":
            axis = ways if component.relaxed.period else times
            out += _by_profile(component, blocks, at, gram, axis)
        elif component.relaxed.periodic:
            starts = [b.at - at[0] for b in blocks]
            shapes = tuple(np.eye(len(at))[:, s] for s in starts)
            labels = tuple(b.component.pitch for b in blocks)
            out.append(Candidate(name=name, effect=component.effect, component=component, at=at,
                                 shapes=shapes, labels=labels))  # fmt: skip
        else:
            own = gram.matrix[np.ix_(at, at)]
            by_law = [_by_law(law, own, gram.readings) for law in laws.get(name, ())]
            forms = (None, *_slower(component, blocks, at, gram), *by_law)
            one = Candidate(
                name=name, effect=component.effect, component=component, at=at, shapes=forms,
                labels=(0.0,) * len(forms), by_law=len(by_law),
            )  # fmt: skip
            out.append(one)
            if component.relaxed.spanned:
                out.append(replace(one, name=f"{name} at edges", at_edges=True))
    return [
        replace(c, listed=at_edges if c.component.relaxed.spanned else "listed")
        if c.at_edges or c.effect in names else c
        for c in out
    ]  # fmt: skip


def _slower(
    component: Component, blocks: Sequence[Block], at: NDArray[np.int64], gram: Gram
) -> tuple[Floats, ...]:
    """Combine a component's columns to slower curves, where it has such.

    Most laws are nearly straight or nearly a parabola; a column's neighbours mostly go with it.
    """
    relaxed = component.relaxed
    inner = gram.matrix[np.ix_(at, at)]
    if relaxed.each == "column":
        place = (np.arange(len(at)) + 0.5) / len(at)
        orders = np.arange(min(SETTINGS.column_waves, len(at)))
        shapes = [np.cos(np.pi * orders * place[:, None]) / (1.0 + orders)]
    elif relaxed.along:
        size = blocks[0].columns.stop - blocks[0].columns.start
        sides = min(len(relaxed.along), 2)
        picked = products(sides, even=relaxed.even)
        orders = np.zeros((size, sides), dtype=np.int64)
        orders[size - len(picked) :] = picked
        falling = (1.0 + orders.sum(axis=1)) ** -SETTINGS.further_decay
        shapes = [np.diag(np.tile(falling, len(blocks)))]
    else:
        return ()
    return tuple(_scaled(s, inner, gram.readings) for s in shapes)


def _by_law(law: Floats, inner: Floats, readings: int) -> Floats:
    """Scale a law's fields (k, f) to unit whitened rms together, each one alike.

    A field that the placement imitates is none: no column is known by more than its doubt.
    """
    energy = np.einsum("kf,kl,lf->f", law, inner, law)
    whole = np.square(law).T @ np.diag(inner)
    own = energy > SETTINGS.doubt**2 * whole
    return _scaled(law * np.where(own, energy, np.inf) ** -0.5, inner, readings)


def _scaled(shape: Floats, inner: Floats, readings: int) -> Floats:
    """Scale a shape (k, l) to unit whitened rms, given X'X of its columns (k, k)."""
    rows = np.flatnonzero(shape.any(axis=1))
    own = shape[rows]
    energy = float((own * (inner[np.ix_(rows, rows)] @ own)).sum())
    return np.asarray(shape * np.sqrt(readings / max(energy, 1e-12)))


def _by_profile(
    component: Component,
    blocks: Sequence[Block],
    at: NDArray[np.int64],
    gram: Gram,
    axis: dict[int, Floats],
) -> list[Candidate]:
    """Bands, free values, and single steps of the profiles.

    A cause's law is a steady wave of one frequency; what is another may grow, fade and be none.
    """
    sizes = [b.columns.stop - b.columns.start for b in blocks]
    starts = np.cumsum([0, *sizes])
    inner = gram.matrix[np.ix_(at, at)]
    what = "slips" if component.relaxed.times else "offsets"

    own_axis = [axis[b.recording] for b in blocks if b.recording is not None]
    span = max(float(np.ptp(values)) for values in own_axis)
    finest = min(float(np.median(np.abs(np.diff(values)))) for values in own_axis)
    count = int(span / finest / 2 / SETTINGS.band_step)
    cycles = SETTINGS.least_cycles + SETTINGS.band_step * np.arange(count, dtype=np.float64)
    frequencies = cycles / span
    frequencies = frequencies[frequencies <= 0.5 / finest]
    bands, steady = (
        _scaled_apart(
            [_bands(values, frequencies, finest, harmonics, envelope) for values in own_axis],
            starts, inner, gram.readings,
        )
        for harmonics, envelope in ((SETTINGS.harmonics, SETTINGS.envelope), (1, 0))
    )  # fmt: skip
    labels = tuple(frequencies.tolist())
    out = [Candidate(
        name=component.name, effect=component.effect, component=component, at=at,
        shapes=(*bands, *steady), labels=2 * labels, by_law=len(steady),
    )] if bands else []  # fmt: skip
    unknown = replace(component, effect="", name=f"free {what} of profiles")
    # each profile for itself, or from where the one before was: lost counts, a belt that creeps
    walks = [np.tri(size)[:, None] for size in sizes]
    (walk,) = _scaled_apart(walks, starts, inner, gram.readings)
    out.append(Candidate(name=unknown.name, effect="", component=unknown, at=at,
                         shapes=(None, walk), labels=(0.0, 0.0)))  # fmt: skip
    steps, places = [], []
    for i, size in enumerate(sizes):
        own = inner[starts[i] : starts[i + 1], starts[i] : starts[i + 1]]
        # energy of all profiles from each one on
        energy = np.diag(own[::-1, ::-1].cumsum(axis=0).cumsum(axis=1))[::-1]
        height = np.sqrt(gram.readings / np.maximum(energy, 1e-12))
        for k in range(2, size - 2):
            shape = np.zeros((starts[-1], 1))
            shape[starts[i] + k : starts[i + 1]] = height[k]
            steps.append(shape)
            places.append(float(k))
    if steps:
        unknown = replace(component, effect="", name=f"step of the {what}")
        out.append(Candidate(name=unknown.name, effect="", component=unknown, at=at,
                             shapes=tuple(steps), labels=tuple(places)))  # fmt: skip
    return out


def _scaled_apart(
    of_each: Sequence[Floats], starts: NDArray[np.int64], inner: Floats, readings: int
) -> tuple[BlockDiagonal, ...]:
    """Join each recording's shapes (profiles, V, l), of unit whitened rms together.

    Single precision: there are hundreds of them, as long as there are profiles.

    Parameters
    ----------
    starts : first profile of each recording, and the end
    inner : X'X of all profiles
    """
    energy = np.zeros(of_each[0].shape[1])
    for i, own in enumerate(of_each):
        rows = slice(starts[i], starts[i + 1])
        flat = own.reshape(len(own), -1)
        products = (flat * (inner[rows, rows] @ flat)).reshape(own.shape)
        energy += products.sum(axis=(0, 2))
    scale = np.sqrt(readings / np.maximum(energy, 1e-12))
    parts = [(own * scale[:, None]).swapaxes(0, 1).astype(np.float32, "C") for own in of_each]
    return tuple(BlockDiagonal(own) for own in zip(*parts, strict=True))


def _bands(
    axis: Floats, frequencies: Floats, finest: float, harmonics: int, envelope: int
) -> Floats:
    """Columns (N, F, l) of oscillations about frequencies (F,), slowly changing, with harmonics.

    Parameters
    ----------
    envelope : polynomial order of the slow change; 0 for a steady one
    """
    u = 2 * (axis - axis.min()) / max(np.ptp(axis), 1e-12) - 1
    slow = legendre.legvander(u, envelope) / (1 + np.arange(envelope + 1))
    columns = []
    for h in range(1, harmonics + 1):
        fits = h * frequencies <= 0.5 / finest
        turns = 2 * np.pi * h * frequencies * axis[:, None]
        waves = np.sin(turns) * fits / h, np.cos(turns) * fits / h
        for change in slow.T if h == 1 else slow.T[:1]:
            columns += [change[:, None] * wave for wave in waves]
    return np.stack(columns, axis=2)
