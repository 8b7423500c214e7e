"""What a dataset lacks is named, and a dataset that lacks nothing is not warned of."""

import copy

import pytest

from pipeline.dataset.shortfalls import shortfalls
from pipeline.dataset.statistics import Statistics

SENSOR = {
    "name": "s", "triangulation_angle_deg": 30.0, "effects": [{"name": "camera_occlusion"}],
}  # fmt: skip


def flaw(split, kind="dent", part="a", pixels=9, detectable=True):
    return {
        "split": split, "kind": kind, "part": part, "pixels": pixels, "pixels_visible": 0,
        "detectable": detectable,
    }  # fmt: skip


def made(*, scans=("train", "train", "test"), flaws=None, surface="x", valid=0.9, sensor=SENSOR):
    statistics = Statistics({"train": 0.6, "test": 0.4})
    for split in scans:
        statistics.add_scan({"split": split, "share_valid": valid, "part": "a", "surface": surface})
    for row in flaws if flaws is not None else [flaw("train"), flaw("test")]:
        statistics.add_flaw(row)
    return {
        "recipe": {"splits": {"train": 0.6, "test": 0.4}, "sensor": sensor},
        "split_by": "part",
        "statistics": statistics.counted(),
    }


def test_nothing_to_warn_of():
    assert shortfalls(made()) == []


@pytest.mark.parametrize(
    ("dataset", "said"),
    [
        (made(flaws=[flaw("train")]), "dent: in no scan of test"),
        (made(flaws=[flaw("train"), flaw("test", pixels=0, detectable=False)]), "in no scan of t"),
        (made(flaws=[flaw("train"), flaw("test", detectable=False)]), "detectable in no scan of t"),
        (made(scans=["train"] * 9 + ["test"]), "train: 90% of the scans instead of 60%"),
        (made(surface=None), "a: no `surface`"),
        (made(valid=0.1), "part a: 10% of the points"),
        (made(sensor={**SENSOR, "triangulation_angle_deg": None}), "no triangulation angle"),
        (made(sensor={**SENSOR, "effects": []}), "`camera_occlusion` not listed"),
    ],
)
def test_each_shortfall_is_named(dataset, said):
    before = copy.deepcopy(dataset)
    assert any(said in line for line in shortfalls(dataset))
    assert dataset == before


def test_a_part_without_a_detectable_flaw_is_named():
    rows = [flaw("train", detectable=False), flaw("test", detectable=False)]
    assert "part a: no detectable flaw in any scan" in shortfalls(made(flaws=rows))
    assert not any("part a" in line for line in shortfalls(made(flaws=[])))
