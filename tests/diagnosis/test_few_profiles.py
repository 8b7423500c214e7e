"""Recordings of a few profiles are diagnosed to the end, judged on whole profiles."""

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.relief import VIEWS, datasheet, part, record
from diagnosis.diagnose import diagnose
from diagnosis.heldout import OWN_SHARE, own_parts
from diagnosis.outputs import write_outputs
from sensors.typed_yaml import RecipeError


@pytest.mark.parametrize("profiles", range(2, 40))
def test_most_profiles_are_judged_on_however_few_they_are(profiles: int) -> None:
    (small,), (scored,) = own_parts([np.ones((profiles, 7), dtype=bool)])
    assert small.any()
    assert np.array_equal(scored, ~small)
    assert small.mean() <= max(0.5, 1.8 / OWN_SHARE)
    assert np.array_equal(small.any(axis=1), small.all(axis=1))


@pytest.mark.parametrize("profiles", [4, 6, 8])
def test_few_profiles_end_in_a_verdict(profiles: int, tmp_path: Path) -> None:
    scene, sheet = part("domes"), datasheet(100)
    made = [
        record(scene, sheet, [], name=f"r{k}", seed=k, profiles=profiles, pitch_mm=0.7, **VIEWS[k])
        for k in range(3)
    ]
    write_outputs(diagnose(made, scene.vertices_mm, scene.faces, sheet), tmp_path)
    content = json.loads((tmp_path / "diagnosis.json").read_text())
    assert content["verdict"] == "match"
    assert np.isfinite(content["heldout"]["after"]["log_score"])


@pytest.mark.parametrize("profiles", [1, 2, 3])
def test_fewer_profiles_than_show_a_correlation_are_refused(profiles: int) -> None:
    scene, sheet = part("domes"), datasheet(100)
    made = record(scene, sheet, [], name="r", seed=0, profiles=profiles, pitch_mm=0.7)
    with pytest.raises(RecipeError, match="r: holds too few profiles.*at least 4"):
        diagnose([made], scene.vertices_mm, scene.faces, sheet)
