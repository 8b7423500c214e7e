"""Verifying: damage is found, a lock holds a release, other versions are compared."""

import json

import pytest

from pipeline.batch import generate
from pipeline.recipe import Recipe
from pipeline.verify import compare_with_lock, verify, write_lock
from sensors.typed_yaml import RecipeError


@pytest.fixture
def made(recipe_path, tmp_path):
    out = tmp_path / "made"
    generate(Recipe.load(recipe_path), out)
    return out


def test_a_whole_dataset_verifies_and_a_damaged_one_does_not(made, tmp_path):
    assert verify(made).wrong == 0
    shard = made / "shard-00001.h5"
    content = bytearray(shard.read_bytes())
    content[len(content) // 2] ^= 1
    shard.write_bytes(content)
    (made / "shard-00002.h5").unlink()
    (made / "shard-00099.h5").write_bytes(b"")
    report = verify(made)
    assert report.wrong == 3
    text = "\n".join(report.lines)
    assert "shard-00001.h5: damaged" in text
    assert "shard-00002.h5: missing" in text
    assert "shard-00099.h5: not part" in text
    with pytest.raises(RecipeError, match="no dataset"):
        verify(tmp_path)


def test_the_manifest_is_held_against_the_scans(made):
    path = made / "manifest.csv"
    path.write_text(path.read_text().replace("a-0000-0001", "a-0000-9999"))
    report = verify(made)
    assert report.wrong == 1
    assert "a-0000-0001" in report.lines[0]


def test_a_lock_holds_a_rebuild(made, recipe_path, tmp_path):
    lock = tmp_path / "locks" / "tiny.lock"
    write_lock(made, lock)
    again = tmp_path / "again"
    generate(Recipe.load(recipe_path), again)
    report = compare_with_lock(again, lock)
    assert report.wrong == 0
    assert "the same bytes" in report.lines[0]

    kept = json.loads(lock.read_text())
    shard = kept["shards"]["shard-00000.h5"]
    shard["sha256"] = "0" * 64
    lock.write_text(json.dumps(kept))
    assert compare_with_lock(again, lock).wrong == 1

    kept["versions"]["numpy"] = "1.0"
    lock.write_text(json.dumps(kept))
    report = compare_with_lock(again, lock)
    assert report.wrong == 0
    assert "numpy 1.0 ->" in report.lines[0]

    shard["depth_mean_mm"] += 0.01
    lock.write_text(json.dumps(kept))
    report = compare_with_lock(again, lock)
    assert report.wrong == 1
    assert "depth_mean_mm" in report.lines[-1]


def test_a_lock_of_another_recipe_is_refused(made, recipe_path, tmp_path):
    lock = tmp_path / "tiny.lock"
    write_lock(made, lock)
    recipe_path.write_text(recipe_path.read_text().replace("seed: 0", "seed: 5"))
    other = tmp_path / "other"
    generate(Recipe.load(recipe_path), other)
    with pytest.raises(RecipeError, match="seed differ"):
        compare_with_lock(other, lock)
