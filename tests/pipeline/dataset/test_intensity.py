"""The brightness of the line goes into shards and recordings where the recipe asks for it."""

import numpy as np
import pytest

from files.errors import RecipeError
from pipeline.batch.run import generate
from pipeline.dataset.export import export
from pipeline.dataset.shards import read_scan
from pipeline.recipe import Recipe
from sensors.line.brightness import LEVELS
from sensors.recording import Recording


def test_shards_and_recordings_hold_it(recipe_path, tmp_path):
    sets = ["intensity={}", "specimens=1", "scans=1", "splits={train: 1.0}"]
    generate(Recipe.load(recipe_path, sets=sets), tmp_path / "out")
    scan = read_scan(tmp_path / "out" / "shard-00000.h5", 0)
    assert scan["intensity"].dtype == np.uint8
    assert (scan["intensity"][np.isnan(scan["depth"])] == 0).all()
    assert (scan["intensity"][np.isfinite(scan["depth"])] > 0).mean() > 0.99
    export(tmp_path / "out", tmp_path / "rec", "recording", [scan["scan_id"]])
    recording = Recording.load(tmp_path / "rec" / f"{scan['scan_id']}.h5")
    np.testing.assert_allclose(recording.intensity, scan["intensity"] / LEVELS, atol=1e-6)
    with pytest.raises(RecipeError, match="where the camera is"):
        Recipe.load(recipe_path, sets=["intensity={}", "sensor=KEYENCE-LJ-X8200"])
