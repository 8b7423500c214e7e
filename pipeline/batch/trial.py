"""A trial: a few scans of a recipe, and a prediction of the whole dataset.

The plan determines the numbers of flaws; the trial estimates the shares that scans show.
"""

import os
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from pipeline.batch.backend import Backend
from pipeline.batch.plan import Plan, PlannedScans, PlannedShard, make_plan
from pipeline.batch.run import find_wanted, no_part, prepare
from pipeline.batch.work import Workplace, make_shard, read_journal
from pipeline.dataset.shortfalls import shortfalls
from pipeline.recipe import Recipe

COUNTS: Final = ("seen", "visible", "detectable")
PARTS_AT_MOST: Final = 8  # tried, evenly among the recipe's; the others are assumed to be similar


@dataclass(frozen=True, kw_only=True, slots=True)
class Trial:
    """Result of a trial.

    Attributes
    ----------
    dataset : dict
        Predicted content of dataset.json; counts are rounded expectations.
    scans : int
        Scans taken.
    parts_tried, parts : int
    seconds : float
        Predicted duration of the whole dataset with one process.
    bytes_on_disk : float
        Size of its shards.
    """

    dataset: Mapping[str, Any]
    scans: int
    parts_tried: int
    parts: int
    seconds: float
    bytes_on_disk: float


@dataclass(frozen=True, kw_only=True, slots=True)
class _Cost:
    """Seconds for a specimen and for a scan, and bytes of a scan, of one part."""

    specimen_s: float
    scan_s: float
    scan_bytes: float


def try_recipe(recipe: Recipe, *, specimens: int = 2, scans: int = 4) -> Trial:
    """Make a few scans of each part and predict the whole dataset.

    Parameters
    ----------
    recipe
        As loaded.
    specimens, scans
        Tried of each part, and of each of these specimens; two scans at least, to tell the cost of
        a scan from that of a specimen.

    Raises
    ------
    PartError
        Where not one part can be used.
    """
    recipe = recipe.ready()
    wanted, failed = find_wanted(recipe)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        place = Workplace(recipe=recipe, out=folder, attributes={})
        place.hidden.mkdir()
        begin = time.perf_counter()
        parts, facts, failed_parts = prepare(recipe, wanted, place.hidden / "parts", Backend())
        loading_s = time.perf_counter() - begin
        failed += failed_parts
        if not parts:
            raise no_part(recipe, wanted, failed)
        plan = make_plan(recipe, parts)
        journals, costs = _tried(place, plan, specimens, max(scans, 2))
    statistics, planned_s, planned_bytes = _expected(recipe, plan, journals, costs)
    dataset: dict[str, Any] = {
        "scans": plan.scans,
        "shards": dict.fromkeys(shard.name for shard in plan.shards),
        "recipe": recipe.as_used(),
        "split_by": plan.split_by,
        "parts": facts,
        "statistics": statistics,
        "failed": failed + [one for journal in journals for one in journal["failed"]],
        "flaws_dropped": [one for journal in journals for one in journal["dropped"]],
    }
    dataset["warnings"] = shortfalls(dataset)
    return Trial(
        dataset=dataset,
        scans=sum(len(journal["scans"]) for journal in journals),
        parts_tried=len(costs),
        parts=len(parts),
        seconds=loading_s + planned_s,
        bytes_on_disk=planned_bytes,
    )


def _tried(
    place: Workplace, plan: Plan, specimens: int, scans: int
) -> tuple[list[dict[str, Any]], dict[str, _Cost]]:
    """Make small shards of flawed specimens of each part; the first scan pays for the cut.

    Specimens without flaws estimate no rate. They are tried where a part has no others.
    """
    by_part: dict[str, list[PlannedScans]] = {}
    for shard in plan.shards:
        for work in shard.work:
            if work.first == 0:
                by_part.setdefault(work.part.name, []).append(work)
    names = list(by_part)
    step = max(len(names) / PARTS_AT_MOST, 1.0)
    names = [names[int(k * step)] for k in range(min(len(names), PARTS_AT_MOST))]
    journals: list[dict[str, Any]] = []
    costs: dict[str, _Cost] = {}
    # compiled code is loaded by a scan that isn't timed
    warm = by_part[names[0]][0]
    make_shard(place, PlannedShard(name="warm.h5", work=(_cut(warm, 0, 1),)))
    for name in names:
        first_s, rest_s, rest, stored = 0.0, 0.0, 0, 0
        # a specimen other than the one tried before, which is still in memory
        flawed = [work for work in by_part[name] if any(work.wanted.values())]
        tried = (flawed or by_part[name])[-specimens:]
        for work in tried:
            most = min(scans, work.last)
            for first, last in ((0, 1), (1, most)):
                if first == last:
                    continue
                label = f"trial-{len(journals):05d}.h5"
                begin = time.perf_counter()
                make_shard(place, PlannedShard(name=label, work=(_cut(work, first, last),)))
                took = time.perf_counter() - begin
                journals.append(read_journal(place, label))
                stored += os.path.getsize(place.out / label)
                if first == 0:
                    first_s += took
                else:
                    rest_s, rest = rest_s + took, rest + last - first
        scan_s = rest_s / rest if rest else first_s / len(tried)
        costs[name] = _Cost(
            specimen_s=max(first_s / len(tried) - scan_s, 0.0),
            scan_s=scan_s,
            scan_bytes=stored / (len(tried) + rest),
        )
    return journals, costs


def _cut(work: PlannedScans, first: int, last: int) -> PlannedScans:
    return replace(work, first=first, last=last, splits=work.splits[first:last], whole=True)


def _expected(
    recipe: Recipe,
    plan: Plan,
    journals: Sequence[Mapping[str, Any]],
    costs: Mapping[str, _Cost],
) -> tuple[dict[str, Any], float, float]:
    """Return statistics as expected of the whole plan, seconds and bytes."""
    rates = _rates([row for journal in journals for row in journal["flaws"]])
    rows = [row for journal in journals for row in journal["scans"]]
    by_split: dict[str, dict[str, Counter[str]]] = {split: {} for split in recipe.file.splits}
    by_part: dict[str, dict[str, Any]] = {}
    by_class: dict[str, Counter[str]] = {}
    scans_by_split = Counter(dict.fromkeys(recipe.file.splits, 0))
    seconds = stored = 0.0
    expected: defaultdict[tuple[str, str, str], float] = defaultdict(float)
    mean = _mean_cost(costs)
    for shard in plan.shards:
        for work in shard.work:
            name, scans = work.part.name, work.last - work.first
            cost = costs.get(name, mean)
            seconds += cost.specimen_s + cost.scan_s * scans
            stored += cost.scan_bytes * scans
            scans_by_split.update(work.splits)
            part = by_part.setdefault(name, _part_facts(name, rows))
            part["scans"] += scans
            if "planned_passes" in part:
                taken = min(max(part["passes_taken"], work.last), part["planned_passes"])
                part["passes_taken"] = taken
            for split, share in Counter(work.splits).items():
                for kind, number in work.wanted.items():
                    flaws = float(number * share)
                    expected[split, kind, "rows"] += flaws
                    part["flaws"] += flaws
                    for count in COUNTS:
                        hits = flaws * rates.get((name, kind, count), rates.get((kind, count), 0.0))
                        expected[split, kind, count] += hits
                        if count != "visible":
                            part[count] += hits
    for (split, kind, count), amount in expected.items():
        by_split[split].setdefault(kind, Counter())[count] = round(amount)
        by_class.setdefault(kind, Counter())[count] += round(amount)
    statistics = {
        "by_class": {kind: dict(counts) for kind, counts in sorted(by_class.items())},
        "by_split": by_split,
        "by_part": by_part,
        "scans_by_split": dict(scans_by_split),
    }
    return statistics, seconds, stored


def _part_facts(name: str, rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    mine = [row for row in rows if row["part"] == name]
    valid = [row["share_valid"] for row in mine]
    planned = [row["planned_passes"] for row in mine if row.get("planned_passes")]
    known = {"planned_passes": planned[0], "passes_taken": 0} if planned else {}
    return {
        **known,
        "scans": 0,
        "share_valid": sum(valid) / len(valid) if valid else None,
        "surface": mine[0]["surface"] if mine else "",  # not tried: nothing is known
        "flaws": 0.0,
        "seen": 0.0,
        "detectable": 0.0,
    }


def _rates(flaws: Sequence[Mapping[str, Any]]) -> dict[tuple[str, ...], float]:
    """Shares of the flaws' rows that are seen, visible, detectable: by part and kind, by kind."""
    hits: Counter[tuple[str, ...]] = Counter()
    total: Counter[tuple[str, ...]] = Counter()
    for row in flaws:
        found = {
            "seen": row["pixels"] > 0,
            "visible": row["pixels_visible"] > 0,
            "detectable": row["detectable"],
        }
        for key in ((row["part"], row["kind"]), (row["kind"],)):
            for count, hit in found.items():
                total[*key, count] += 1
                hits[*key, count] += hit
    return {key: hits[key] / number for key, number in total.items()}


def _mean_cost(costs: Mapping[str, _Cost]) -> _Cost:
    all_costs = list(costs.values())
    return _Cost(
        **{
            key: sum(getattr(cost, key) for cost in all_costs) / len(all_costs)
            for key in ("specimen_s", "scan_s", "scan_bytes")
        }
    )
