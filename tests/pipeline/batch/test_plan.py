"""The plan: shards in order, specimens whole, splits without leaks."""

from collections import Counter, defaultdict

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from files.yaml_document import Document
from pipeline.batch.plan import PlannedPart, in_turns, make_plan
from pipeline.batch.splits import Unit, assign
from pipeline.injection.flawplan import FlawPlan
from pipeline.recipe import PartEntry, Recipe, RecipeFile
from sensors.datasheet import Datasheet
from sensors.model import SensorModel

SHEET = Datasheet(
    name="s",
    working_distance_mm=100.0,
    z_range_mm=50.0,
    x_fov_mm=50.0,
    points_per_profile=11,
    z_resolution_um=1.0,
    profile_rate_hz=500.0,
)


def planned(counts, scans, splits, size, split_by=None):
    entries = tuple(PartEntry(builtin="steel_plate", specimens=count) for count in counts)
    file = RecipeFile(
        name="r", seed=1, sensor="s", parts=entries, profiles=10, scans=scans, splits=splits,
        scans_per_shard=size, split_by=split_by,
    )  # fmt: skip
    recipe = Recipe(
        file=file, sensor=SensorModel(SHEET), surfaces={},
        document=Document(path="", data={}, lines={}), roots=(),
    )  # fmt: skip
    parts = [PlannedPart(name=f"p{i}", entry=e, stored="") for i, e in enumerate(entries)]
    return make_plan(recipe, parts)


@settings(max_examples=60, deadline=None)
@given(
    counts=st.lists(st.integers(1, 5), min_size=1, max_size=6),
    scans=st.integers(1, 9),
    size=st.one_of(st.none(), st.integers(1, 7)),
    shares=st.sampled_from([{"train": 1.0}, {"train": 0.7, "val": 0.2, "test": 0.1}]),
)
def test_every_scan_once_and_no_part_in_two_splits(counts, scans, size, shares):
    plan = planned(counts, scans, shares, size)
    seen = defaultdict(list)
    splits = defaultdict(set)
    for shard in plan.shards:
        assert shard.scans <= max(size or 64, scans if size is None else size)
        for work in shard.work:
            seen[work.specimen_id].extend(range(work.first, work.last))
            unit = work.part.name if plan.split_by == "part" else work.specimen_id
            splits[unit].update(work.splits)
    assert len(seen) == sum(counts)
    assert all(found == list(range(scans)) for found in seen.values())
    assert all(len(found) == 1 for found in splits.values())
    assert plan.split_by == ("part" if len(counts) >= len(shares) else "specimen")
    assert [shard.name for shard in plan.shards] == sorted(shard.name for shard in plan.shards)


def alike(count):
    return {f"p{i}": Unit(scans=1, labels={}) for i in range(count)}


def counts_of(chosen):
    return Counter(chosen.values())


@settings(max_examples=60, deadline=None)
@given(
    count=st.integers(3, 60),
    shares=st.sampled_from([(0.8, 0.1, 0.1), (0.6, 0.2, 0.2), (0.5, 0.25, 0.25)]),
    seed=st.integers(0, 99),
)
def test_shares_are_met_to_the_nearest_whole_unit_and_no_split_is_empty(count, shares, seed):
    splits = dict(zip(("train", "val", "test"), shares, strict=True))
    found = counts_of(assign(splits, seed, alike(count)))
    assert sum(found.values()) == count
    for split, share in splits.items():
        assert found[split] >= 1
        assert abs(found[split] - share * count) < 1 or found[split] == 1 or count * min(shares) < 1


def test_three_parts_of_unequal_size_still_fill_every_split():
    units = {"a": Unit(scans=50, labels={}), "b": Unit(scans=1, labels={}),
             "c": Unit(scans=1, labels={})}  # fmt: skip
    assert set(assign({"train": 0.98, "val": 0.01, "test": 0.01}, 5, units).values()) == {
        "train", "val", "test"
    }  # fmt: skip


def test_a_rare_kind_is_spread_over_the_splits():
    units = {
        f"u{i}": Unit(scans=2, labels={"dent": 1, "crack": 3 if i % 10 == 0 else 0})
        for i in range(60)
    }
    for seed in range(10):
        chosen = assign({"train": 0.5, "val": 0.25, "test": 0.25}, seed, units)
        assert counts_of(chosen) == {"train": 30, "val": 15, "test": 15}
        cracked = Counter(split for name, split in chosen.items() if units[name].labels["crack"])
        assert cracked["train"] == 3
        assert {cracked["val"], cracked["test"]} == {1, 2}


def test_another_seed_shuffles_the_splits():
    units = alike(40)
    shares = {"a": 0.5, "b": 0.5}
    assert assign(shares, 1, units) != assign(shares, 2, units)
    assert assign(shares, 1, units) == assign(shares, 1, dict(reversed(units.items())))


@pytest.mark.parametrize("split_by", ["part", "specimen", "scan"])
def test_split_by_says_what_stays_whole(split_by):
    plan = planned([4, 4, 4], 4, {"train": 0.5, "val": 0.25, "test": 0.25}, 3, split_by=split_by)
    units = defaultdict(set)
    scans = Counter()
    for shard in plan.shards:
        for work in shard.work:
            assert work.split_by == split_by
            for number, split in zip(range(work.first, work.last), work.splits, strict=True):
                unit = {
                    "part": work.part.name, "specimen": work.specimen_id,
                    "scan": (work.specimen_id, number),
                }[split_by]  # fmt: skip
                units[unit].add(split)
                scans[split] += 1
    assert all(len(found) == 1 for found in units.values())
    by_part = {"train": 16, "val": 16, "test": 16}
    assert scans == (by_part if split_by == "part" else {"train": 24, "val": 12, "test": 12})


def test_a_large_specimen_is_cut_into_shards():
    plan = planned([1], 10, {"train": 1.0}, 4)
    assert [shard.scans for shard in plan.shards] == [3, 3, 4]


def test_few_scans_still_make_many_shards():
    assert len(planned([24], 2, {"train": 1.0}, None).shards) >= 12
    with pytest.raises(ValueError, match="add up to 1"):
        planned([1], 1, {"train": 0.5}, None)


def test_shards_of_a_specimen_are_not_made_at_once():
    """Each would wait until the other has cut it."""
    plan = planned([3, 2], 6, {"train": 1.0}, 2)
    cost = {shard.name: 100 - k for k, shard in enumerate(plan.shards)}
    order = in_turns(plan.shards, cost)
    assert sorted(s.name for s in order) == sorted(s.name for s in plan.shards)
    specimens = [shard.work[0].specimen_id for shard in order]
    assert len(set(specimens[:5])) == len(set(specimens[5:10])) == 5
    for turn in (order[:5], order[5:10], order[10:]):
        costs = [cost[shard.name] for shard in turn]
        assert costs == sorted(costs, reverse=True)


def test_good_specimens_of_each_part_are_spread_over_the_splits():
    entries = tuple(PartEntry(builtin="steel_plate", name=f"p{i}") for i in range(3))
    file = RecipeFile(
        name="r", seed=1, sensor="s", parts=entries, profiles=10, specimens=6, good_specimens=4,
        splits={"train": 0.5, "val": 0.25, "test": 0.25}, split_by="specimen",
        flaws=FlawPlan.from_mapping({"dent": 1, "pit": {"number": {"choice": [1, 2]}}}),
    )  # fmt: skip
    recipe = Recipe(
        file=file, sensor=SensorModel(SHEET), surfaces={},
        document=Document(path="", data={}, lines={}), roots=(),
    )  # fmt: skip
    parts = [PlannedPart(name=f"p{i}", entry=e, stored="") for i, e in enumerate(entries)]
    good = defaultdict(Counter)
    for shard in make_plan(recipe, parts).shards:
        for work in shard.work:
            if not any(work.wanted.values()):
                good[work.part.name].update(work.splits)
    assert {name: dict(counts) for name, counts in good.items()} == {
        f"p{i}": {"train": 2, "val": 1, "test": 1} for i in range(3)
    }
