"""The plan of a dataset: specimens, their splits, numbers of scans, and shards."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pipeline.batch.splits import Unit, assign
from pipeline.recipe import PartEntry, Recipe
from pipeline.seeds import streams


@dataclass(frozen=True, kw_only=True, slots=True)
class PlannedPart:
    """A part that loaded: its name, its entry of the recipe and where its solid is kept."""

    name: str
    entry: PartEntry
    stored: str


@dataclass(frozen=True, kw_only=True, slots=True)
class PlannedScans:
    """Scans `first` up to `last` (half-open) of one specimen; whether they are all its scans.

    `splits` names the split of each scan, `wanted` the number of flaws of each kind.
    """

    part: PlannedPart
    specimen: int
    splits: tuple[str, ...]
    split_by: str
    first: int
    last: int
    wanted: Mapping[str, int]
    whole: bool = True

    @property
    def specimen_id(self) -> str:
        """Name of the specimen, unique in the dataset."""
        return f"{self.part.name}-{self.specimen:04d}"


@dataclass(frozen=True, kw_only=True, slots=True)
class PlannedShard:
    """Scans of one shard."""

    name: str
    work: tuple[PlannedScans, ...]

    @property
    def scans(self) -> int:
        """Number of scans."""
        return sum(scans.last - scans.first for scans in self.work)


@dataclass(frozen=True, kw_only=True, slots=True)
class Plan:
    """All shards, and the unit of the splits ('part', 'specimen' or 'scan')."""

    shards: tuple[PlannedShard, ...]
    split_by: str

    @property
    def scans(self) -> int:
        """Number of scans."""
        return sum(shard.scans for shard in self.shards)


MOST_PER_SHARD, LEAST_SHARDS = 64, 16


def make_plan(recipe: Recipe, parts: Sequence[PlannedPart]) -> Plan:
    """Plan the dataset; the plan is independent of the number of workers.

    By default the unit of the splits is the part; with fewer parts than splits, the specimen.
    Shards hold whole specimens, unless one specimen exceeds a shard.
    """
    file = recipe.file
    counts = {part.name: recipe.specimens_of(part.entry) for part in parts}
    split_by = file.split_by or ("part" if len(parts) >= len(file.splits) else "specimen")
    wanted = {
        (part.name, number): _wanted(recipe, part, number)
        for part in parts
        for number in range(counts[part.name])
    }
    split_of = _splits(recipe, parts, split_by, wanted)
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
                    splits=split_of[part.name, specimen][
                        scans * piece // pieces : scans * (piece + 1) // pieces
                    ],
                    split_by=split_by,
                    first=scans * piece // pieces,
                    last=scans * (piece + 1) // pieces,
                    wanted=wanted[part.name, specimen],
                    whole=pieces == 1,
                )
                held.append(work)
                if not work.whole:
                    close()
    close()
    return Plan(shards=tuple(shards), split_by=split_by)


def _wanted(recipe: Recipe, part: PlannedPart, number: int) -> dict[str, int]:
    """How many flaws of each kind a specimen is to have, as its injection will draw them."""
    rng_of = streams(recipe.file.seed, part.name, number, "flaws")
    return recipe.flaws_of(part.entry, number).numbers(rng_of)


def _splits(
    recipe: Recipe,
    parts: Sequence[PlannedPart],
    split_by: str,
    wanted: Mapping[tuple[str, int], Mapping[str, int]],
) -> dict[tuple[str, int], tuple[str, ...]]:
    """Give each scan of each specimen its split."""
    file = recipe.file
    scans = {part.name: part.entry.scans or file.scans for part in parts}

    def units_of(name: str, specimen: int) -> list[str]:
        if split_by == "part":
            return [name]
        if split_by == "specimen":
            return [f"{name}-{specimen}"]
        return [f"{name}-{specimen}-{scan}" for scan in range(scans[name])]

    sizes: Counter[str] = Counter()
    labels: dict[str, Counter[str]] = {}
    for (name, specimen), kinds in wanted.items():
        mine = units_of(name, specimen)
        # good specimens of each part are a kind of their own: every split has to see some
        carried = kinds if any(kinds.values()) else {f"good {name}": 1}
        for unit in mine:
            sizes[unit] += scans[name] // len(mine)
            labels.setdefault(unit, Counter()).update({**carried, f"part {name}": 1})
    units = {unit: Unit(scans=sizes[unit], labels=labels[unit]) for unit in sizes}
    chosen = assign(file.splits, file.seed, units)
    found = {}
    for name, specimen in wanted:
        mine = [chosen[unit] for unit in units_of(name, specimen)]
        found[name, specimen] = tuple(mine * (scans[name] // len(mine)))
    return found


def in_turns(shards: Sequence[PlannedShard], cost: Mapping[str, int]) -> list[PlannedShard]:
    """Order shards: a first one of every specimen, then a second one; the most expensive first.

    Two of one specimen at once would both wait until it is cut; at the end short waits are best.
    """
    turns: Counter[str] = Counter()
    order = {}
    for shard in sorted(shards, key=lambda shard: -cost[shard.name]):
        specimen = shard.work[0].specimen_id
        order[shard.name] = turns[specimen], -cost[shard.name]
        turns[specimen] += 1
    return sorted(shards, key=lambda shard: order[shard.name])
