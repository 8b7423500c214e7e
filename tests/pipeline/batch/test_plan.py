"""The plan: shards in order, specimens whole, splits without leaks."""

from collections import defaultdict

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.batch.plan import PlannedPart, assign, make_plan
from pipeline.recipe import PartEntry, Recipe, RecipeFile
from sensors.datasheet import Datasheet
from sensors.model import SensorModel
from sensors.typed_yaml import Document

SHEET = Datasheet(
    name="s",
    working_distance_mm=100.0,
    z_range_mm=50.0,
    x_fov_mm=50.0,
    points_per_profile=11,
    z_resolution_um=1.0,
    profile_rate_hz=500.0,
)


def planned(counts, scans, splits, size):
    entries = tuple(PartEntry(builtin="steel_plate", specimens=count) for count in counts)
    file = RecipeFile(
        name="r", seed=1, sensor="s", parts=entries, profiles=10, scans=scans, splits=splits,
        scans_per_shard=size,
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
            splits[unit].add(work.split)
    assert len(seen) == sum(counts)
    assert all(found == list(range(scans)) for found in seen.values())
    assert all(len(found) == 1 for found in splits.values())
    assert plan.split_by == ("part" if len(counts) >= len(shares) else "specimen")
    assert [shard.name for shard in plan.shards] == sorted(shard.name for shard in plan.shards)


def test_splits_come_near_their_shares_and_none_is_empty():
    chosen = assign({"train": 0.8, "val": 0.1, "test": 0.1}, 5, {f"p{i}": 1 for i in range(100)})
    counts = {s: list(chosen.values()).count(s) for s in ("train", "val", "test")}
    assert counts == {"train": 80, "val": 10, "test": 10}
    few = assign({"train": 0.98, "val": 0.01, "test": 0.01}, 5, {"a": 1, "b": 1, "c": 1})
    assert set(few.values()) == {"train", "val", "test"}


def test_another_seed_shuffles_the_splits():
    units = {f"p{i}": 1 for i in range(40)}
    shares = {"a": 0.5, "b": 0.5}
    assert assign(shares, 1, units) != assign(shares, 2, units)
    assert assign(shares, 1, units) == assign(shares, 1, dict(reversed(units.items())))


def test_a_large_specimen_is_cut_into_shards():
    plan = planned([1], 10, {"train": 1.0}, 4)
    assert [shard.scans for shard in plan.shards] == [3, 3, 4]


def test_few_scans_still_make_many_shards():
    assert len(planned([24], 2, {"train": 1.0}, None).shards) >= 12
    with pytest.raises(ValueError, match="add up to 1"):
        planned([1], 1, {"train": 0.5}, None)
