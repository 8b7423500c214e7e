"""What a diagnosis is given: profiles that repeat are told and counted."""

from dataclasses import replace

import numpy as np

from benchmarks.relief import datasheet, part, record
from diagnosis.inputs import repeats


def test_repeated_profiles_are_a_finding_from_one_in_a_hundred() -> None:
    made = record(part("domes"), datasheet(60), [], name="r", seed=4, profiles=200, pitch_mm=0.2)
    notes: list[str] = []
    assert repeats([made], notes) == []
    assert notes == []
    depth = made.depth_mm.copy()
    depth[40] = depth[39]
    assert repeats([replace(made, depth_mm=depth)], notes) == []
    assert "1 of 200 profiles" in notes[0]
    for row in range(60, 160, 10):
        depth[row] = depth[row - 1]
    found = repeats([replace(made, depth_mm=depth)], notes)
    assert [f.name for f in found] == ["repeats"]
    assert np.isclose(found[0].size, 11 / 200)
    assert found[0].matters
