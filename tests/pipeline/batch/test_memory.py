"""Memory doesn't grow with the number of scans, and what was scanned is let go."""

import gc
from collections.abc import Iterator
from pathlib import Path

import pytest

from pipeline.batch.plan import make_plan
from pipeline.batch.run import Backend, find_wanted, prepare
from pipeline.batch.work import Workplace, make_shard
from pipeline.injection.specimen import Specimen
from pipeline.recipe import Recipe
from pipeline.scan.labelled_scan import Scan

STATUS = Path("/proc/self/status")
PROFILES, POINTS = 100, 200


def resident_bytes() -> int:
    (line,) = (line for line in STATUS.read_text().splitlines() if line.startswith("VmRSS"))
    return int(line.split()[1]) * 1024


def shards_of(recipe_path: Path, out: Path, work: str) -> Iterator[int]:
    """Make the shards of one plate, one after the other; yields the scans in each."""
    text = recipe_path.read_text()
    second = text.index("  - builtin: steel_plate\n    name: b")
    text = text[:second] + text[text.index("flaws:") :]
    for old, new in (
        ("profiles: 40", f"profiles: {PROFILES}\npoints: {POINTS}"),
        ("splits: {train: 0.5, test: 0.5}\n", ""),
        ("specimens: 3\nscans: 2\nscans_per_shard: 2\n", work),
    ):
        assert old in text
        text = text.replace(old, new)
    recipe_path.write_text(text)
    recipe = Recipe.load(recipe_path).ready()
    hidden = out / ".flawforge"
    hidden.mkdir(parents=True)
    wanted, _ = find_wanted(recipe)
    parts, _, _ = prepare(recipe, wanted, hidden / "parts", Backend())
    place = Workplace(recipe=recipe, out=out, attributes={})
    for shard in make_plan(recipe, parts).shards:
        yield make_shard(place, shard)[1]


@pytest.mark.skipif(not STATUS.exists(), reason="no /proc to read the memory from")
def test_memory_for_many_scans_is_that_for_few(recipe_path, tmp_path):
    shards = shards_of(recipe_path, tmp_path / "out", "scans: 240\nscans_per_shard: 20\n")
    assert sum(next(shards) for _ in range(3)) == 60
    before = resident_bytes()
    scans = sum(shards)
    assert scans == 180
    # one array of each scan, kept, would be four times as much
    assert resident_bytes() - before < scans * PROFILES * POINTS * 8 / 4


def test_what_was_scanned_is_let_go(recipe_path, tmp_path):
    def alive() -> tuple[int, int]:
        gc.collect()
        things = gc.get_objects()
        return (
            sum(type(thing) is Specimen for thing in things),
            sum(type(thing) is Scan for thing in things),
        )

    shards = shards_of(recipe_path, tmp_path / "out", "specimens: 5\nscans_per_shard: 1\n")
    specimens, scans = alive()  # of other tests
    for made in shards:
        assert made == 1
        # the last specimen stays, for a next shard of it
        assert alive()[0] <= specimens + 1
        assert alive()[1] == scans
