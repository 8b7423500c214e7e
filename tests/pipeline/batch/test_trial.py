"""A trial predicts what generate then makes: counts, bytes, and warnings before the night."""

import pandas as pd
import pytest

from pipeline.batch.run import generate
from pipeline.batch.trial import try_recipe
from pipeline.recipe import Recipe


def test_a_trial_of_every_scan_predicts_the_dataset_itself(recipe_path, made_once):
    trial = try_recipe(Recipe.load(recipe_path), specimens=3, scans=2)
    assert trial.scans == trial.dataset["scans"] == 12
    flaws = pd.read_parquet(made_once / "flaws.parquet")
    by_class = trial.dataset["statistics"]["by_class"]
    for kind, rows in flaws.groupby("kind"):
        counts = by_class[kind]
        assert counts["rows"] == len(rows)
        assert counts["seen"] == pytest.approx((rows["pixels"] > 0).sum(), abs=1)
        assert counts["detectable"] == pytest.approx(rows["detectable"].sum(), abs=1)
    manifest = pd.read_parquet(made_once / "manifest.parquet")
    counted = manifest["split"].value_counts().to_dict()
    assert trial.dataset["statistics"]["scans_by_split"] == counted
    size = sum(path.stat().st_size for path in made_once.glob("shard-*.h5"))
    assert trial.bytes_on_disk == pytest.approx(size, rel=0.5)  # small shards are mostly headers
    assert trial.seconds > 0


def test_a_trial_warns_of_what_generate_warns_of(recipe_path, tmp_path):
    sets = ["seed=3", "motion.aim_at_flaws=1"]
    dataset = generate(Recipe.load(recipe_path, sets=sets), tmp_path / "out")
    trial = try_recipe(Recipe.load(recipe_path, sets=sets), specimens=3, scans=2)
    assert dataset["warnings"] == trial.dataset["warnings"]
    assert any("camera_occlusion" in text for text in dataset["warnings"])
    assert not list(recipe_path.parent.glob("*.h5"))


def test_a_trial_tries_flawed_specimens_where_a_recipe_adds_good_ones(recipe_path):
    sets = ["good_specimens=3", "motion.aim_at_flaws=1"]
    trial = try_recipe(Recipe.load(recipe_path, sets=sets), specimens=2, scans=2)
    by_class = trial.dataset["statistics"]["by_class"]
    assert sum(counts["seen"] for counts in by_class.values()) > 0
