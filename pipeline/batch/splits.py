"""Splits of parts, specimens or scans into training, validation and test.

Shares are met to the nearest whole unit; within that, units that carry rare kinds of flaw are
dealt out first, each to the split that lacks its rarest kind most (iterative stratification:
Sechidis, Tsoumakas and Vlahavas, ECML PKDD 2011, algorithm 1, here with fixed sizes).
"""

import hashlib
import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pipeline.seeds import seed_of


@dataclass(frozen=True, kw_only=True, slots=True)
class Unit:
    """A unit that no split divides.

    Attributes
    ----------
    scans : int
        Its size.
    labels : mapping
        How much it holds of each label (kind of flaw, part), to be spread over the splits.
    """

    scans: int
    labels: Mapping[str, float]


def assign(splits: Mapping[str, float], seed: int, units: Mapping[str, Unit]) -> dict[str, str]:
    """Give each unit to a split.

    Parameters
    ----------
    splits
        Wanted share of the scans of each; together 1.
    seed
        Draws the order among units that are alike; their order in `units` has no say.
    units
        By name.

    Returns
    -------
    dict
        Split of each unit. Each split has a unit where there are enough.
    """
    table = _Table(splits, units)
    left = sorted(units, key=lambda name: _lot(seed, name))
    for label in _rarest_first(units):
        for name in left:
            if units[name].labels.get(label, 0) > 0:
                table.give(name, label)
        left = [name for name in left if name not in table.chosen]
    for name in left:
        table.give(name, None)
    return table.chosen


class _Table:
    """Where units are dealt out: what each split still has room for and lacks of each label."""

    def __init__(self, splits: Mapping[str, float], units: Mapping[str, Unit]) -> None:
        self._units = units
        self._room = _room(splits, units)
        self._empty = set(splits)
        self.chosen: dict[str, str] = {}
        totals: Counter[str] = Counter()
        for unit in units.values():
            totals.update(unit.labels)
        self._lacks = {
            label: {split: share * total for split, share in splits.items()}
            for label, total in totals.items()
        }

    def give(self, name: str, label: str | None) -> None:
        """Put a unit into the split that lacks `label` most, then its labels, then units."""
        unit = self._units[name]
        open_to = [split for split, scans in self._room.items() if scans >= unit.scans / 2]
        if len(self._units) - len(self.chosen) <= len(self._empty):
            open_to = [split for split in self._room if split in self._empty]

        def lack(split: str) -> tuple[float, float, float]:
            own = self._lacks[label][split] if label is not None else 0.0
            return own, sum(self._lacks[one][split] for one in unit.labels), self._room[split]

        best = max(open_to or list(self._room), key=lack)
        self.chosen[name] = best
        self._empty.discard(best)
        self._room[best] -= unit.scans
        for one, amount in unit.labels.items():
            self._lacks[one][best] -= amount


def _room(splits: Mapping[str, float], units: Mapping[str, Unit]) -> dict[str, float]:
    """Return the scans that each split may hold; units of one size: whole, by largest remainder."""
    total = sum(unit.scans for unit in units.values())
    room = {split: share * total for split, share in splits.items()}
    sizes = {unit.scans for unit in units.values()}
    if len(sizes) != 1:
        return room
    size = sizes.pop()
    whole = {split: math.floor(scans / size + 1e-9) for split, scans in room.items()}
    rest = sorted(splits, key=lambda split: whole[split] - room[split] / size)
    for split in rest[: len(units) - sum(whole.values())]:
        whole[split] += 1
    if len(units) >= len(splits):
        for split in splits:
            if whole[split] == 0:
                whole[max(whole, key=lambda one: whole[one])] -= 1
                whole[split] = 1
    return {split: float(size * count) for split, count in whole.items()}


def _rarest_first(units: Mapping[str, Unit]) -> list[str]:
    """Labels by the number of units that carry them."""
    carried = Counter(
        label for unit in units.values() for label, amount in unit.labels.items() if amount > 0
    )
    return sorted(carried, key=lambda label: (carried[label], label))


def _lot(seed: int, name: str) -> bytes:
    words = seed_of(seed, "split", name).generate_state(4)
    return hashlib.sha256(np.asarray(words, dtype="<u4").tobytes()).digest()
