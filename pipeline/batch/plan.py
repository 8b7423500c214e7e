"""The plan of a dataset: which specimens, in which split, scanned how often, in which shard."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.recipe import PartEntry, Recipe
from pipeline.seeds import seed_of


@dataclass(frozen=True, kw_only=True, slots=True)
class PlannedPart:
    """A part that loaded: its name, its entry of the recipe and where its solid is kept."""

    name: str
    entry: PartEntry
    stored: str


@dataclass(frozen=True, kw_only=True, slots=True)
class PlannedScans:
    """Scans `first` up to `last` (half-open) of one specimen; whether these are all it has."""

    part: PlannedPart
    specimen: int
    split: str
    split_by: str
    first: int
    last: int
    whole: bool = True

    @property
    def specimen_id(self) -> str:
        """Name of the specimen, unique in the dataset."""
        return f"{self.part.name}-{self.specimen:04d}"


@dataclass(frozen=True, kw_only=True, slots=True)
class PlannedShard:
    """What goes into one shard."""

    name: str
    work: tuple[PlannedScans, ...]

    @property
    def scans(self) -> int:
        """Number of scans."""
        return sum(scans.last - scans.first for scans in self.work)


@dataclass(frozen=True, kw_only=True, slots=True)
class Plan:
    """All shards, and by what the splits were made ('part' or 'specimen')."""

    shards: tuple[PlannedShard, ...]
    split_by: str

    @property
    def scans(self) -> int:
        """Number of scans."""
        return sum(shard.scans for shard in self.shards)


MOST_PER_SHARD, LEAST_SHARDS = 64, 16


def make_plan(recipe: Recipe, parts: Sequence[PlannedPart]) -> Plan:
    """Lay out the dataset; the number of workers has no say in it.

    Splits are made by part, so that no part is in two of them; with fewer parts than splits, by
    specimen. Shards hold whole specimens, unless one alone is larger than a shard.
    """
    file = recipe.file
    counts = {part.name: part.entry.specimens or file.specimens for part in parts}
    split_by = "part" if len(parts) >= len(file.splits) else "specimen"
    if split_by == "part":
        by_part = assign(file.splits, file.seed, {name: counts[name] for name in counts})
        split_of = {(n, k): by_part[n] for n in counts for k in range(counts[n])}
    else:
        units = {f"{n}-{k}": 1 for n in counts for k in range(counts[n])}
        by_unit = assign(file.splits, file.seed, units)
        split_of = {(n, k): by_unit[f"{n}-{k}"] for n in counts for k in range(counts[n])}
    total = sum(counts[p.name] * (p.entry.scans or file.scans) for p in parts)
    size = file.scans_per_shard or min(MOST_PER_SHARD, max(1, -(-total // LEAST_SHARDS)))
    shards: list[PlannedShard] = []
    held: list[PlannedScans] = []

    def close() -> None:
        if held:
            shards.append(PlannedShard(name=f"shard-{len(shards):05d}.h5", work=tuple(held)))
            held.clear()

    for part in parts:
        scans = part.entry.scans or file.scans
        for specimen in range(counts[part.name]):
            filled = sum(work.last - work.first for work in held)
            if filled and filled + scans > size:
                close()
            pieces = -(-scans // size)
            for piece in range(pieces):  # of one size, so that none is waited for
                work = PlannedScans(
                    part=part,
                    specimen=specimen,
                    split=split_of[(part.name, specimen)],
                    split_by=split_by,
                    first=scans * piece // pieces,
                    last=scans * (piece + 1) // pieces,
                    whole=pieces == 1,
                )
                held.append(work)
                if not work.whole:
                    close()
    close()
    return Plan(shards=tuple(shards), split_by=split_by)


def assign(splits: dict[str, float], seed: int, units: dict[str, int]) -> dict[str, str]:
    """Give each unit (with its number of specimens) to a split, near the wanted shares.

    Units come in an order drawn from the seed; each goes to the split that lacks most. A split
    gets at least one unit where there are enough.
    """
    order = sorted(units, key=lambda name: _lot(seed, name))
    total = sum(units.values())
    got = dict.fromkeys(splits, 0)
    chosen: dict[str, str] = {}
    for position, name in enumerate(order):
        empty = [split for split in splits if split not in chosen.values()]
        left = len(order) - position
        open_to = empty if empty and left <= len(empty) else list(splits)
        lack = {split: splits[split] - got[split] / total for split in open_to}
        best = max(open_to, key=lambda split: lack[split])
        chosen[name] = best
        got[best] += units[name]
    return chosen


def _lot(seed: int, name: str) -> bytes:
    words = seed_of(seed, "split", name).generate_state(4)
    return hashlib.sha256(np.asarray(words, dtype="<u4").tobytes()).digest()
