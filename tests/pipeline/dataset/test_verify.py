"""Verifying: damage is found, a lock holds a release, other versions are compared."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from files.errors import RecipeError
from pipeline.batch.run import generate
from pipeline.dataset.checksums import NAME, own_files
from pipeline.dataset.verify import compare_with_lock, read_dataset, verify, write_lock
from pipeline.recipe import Recipe


def test_a_whole_dataset_verifies_and_a_damaged_one_does_not(once, tmp_path):
    assert verify(once).wrong == 0
    shard = once / "shard-00001.h5"
    content = bytearray(shard.read_bytes())
    content[len(content) // 2] ^= 1
    shard.write_bytes(content)
    (once / "shard-00002.h5").unlink()
    (once / "shard-00099.h5").write_bytes(b"")
    report = verify(once)
    assert report.wrong == 3
    text = "\n".join(report.lines)
    assert "shard-00001.h5: damaged" in text
    assert "shard-00002.h5: missing" in text
    assert "shard-00099.h5: not part" in text
    with pytest.raises(RecipeError, match="no dataset"):
        verify(tmp_path)


def test_the_manifest_is_held_against_the_scans(once):
    path = once / "manifest.csv"
    path.write_text(path.read_text().replace("a-0000-0001", "a-0000-9999"))
    report = verify(once)
    assert report.wrong == 1
    assert "a-0000-0001" in report.lines[0]


def test_a_lock_holds_a_rebuild(once, tmp_path):
    lock = tmp_path / "locks" / "tiny.lock"
    write_lock(once, lock)
    report = compare_with_lock(once, lock)
    assert report.wrong == 0
    assert "the same bytes" in report.lines[0]

    kept = json.loads(lock.read_text())
    shard = kept["shards"]["shard-00000.h5"]
    shard["sha256"] = "0" * 64
    lock.write_text(json.dumps(kept))
    assert compare_with_lock(once, lock).wrong == 1

    kept["versions"]["numpy"] = "1.0"
    lock.write_text(json.dumps(kept))
    report = compare_with_lock(once, lock)
    assert report.wrong == 0
    assert "numpy 1.0 ->" in report.lines[0]

    shard["depth_mean_mm"] += 0.01
    lock.write_text(json.dumps(kept))
    report = compare_with_lock(once, lock)
    assert report.wrong == 1
    assert "depth_mean_mm" in report.lines[-1]


def test_a_lock_of_another_recipe_is_refused(once, recipe_path, tmp_path):
    lock = tmp_path / "tiny.lock"
    write_lock(once, lock)
    recipe_path.write_text(recipe_path.read_text().replace("seed: 0", "seed: 5"))
    other = tmp_path / "other"
    generate(Recipe.load(recipe_path), other)
    with pytest.raises(RecipeError, match="seed differ"):
        compare_with_lock(other, lock)


def test_a_list_of_checksums_that_was_removed_is_named(once):
    (once / NAME).unlink()
    report = verify(once)
    assert report.wrong == 1
    assert f"{NAME}: missing" in report.lines


def test_every_flip_in_every_file_is_noticed(once):
    rng = np.random.default_rng(0)
    for name in [*own_files(once), NAME]:
        path = once / name
        before = path.read_bytes()
        for _ in range(12):
            data = bytearray(before)
            data[int(rng.integers(len(data)))] ^= 1 << int(rng.integers(8))
            path.write_bytes(bytes(data))
            report = verify(once)
            assert report.wrong > 0, name
            assert any(line.startswith(name) or NAME in line for line in report.lines)
        path.write_bytes(before)
    assert verify(once).wrong == 0


def test_swapped_removed_added_and_truncated_files_are_named(once):
    one, other = once / "shard-00000.h5", once / "shard-00001.h5"
    first, second = one.read_bytes(), other.read_bytes()
    one.write_bytes(second)
    other.write_bytes(first)
    lines = "\n".join(verify(once).lines)
    assert "shard-00000.h5: holds what shard-00001.h5 should hold" in lines
    one.write_bytes(first)
    other.write_bytes(second)
    (once / "flaws.csv").unlink()
    (once / "manifest.parquet").write_bytes((once / "manifest.parquet").read_bytes()[:-9])
    lines = "\n".join(verify(once).lines)
    assert "flaws.csv: missing" in lines
    assert "manifest.parquet: damaged" in lines


def test_a_rewritten_table_is_another_form_of_the_same_content(once):
    for end in ("csv", "parquet"):
        path = once / f"manifest.{end}"
        table = pd.read_csv(path) if end == "csv" else pd.read_parquet(path)
        before = path.read_bytes()
        if end == "csv":
            table.to_csv(path, index=False, lineterminator="\r\n")
        else:
            table.to_parquet(path, compression="gzip")
        assert verify(once).wrong == 1
        report = verify(once, content=True)
        assert report.wrong == 0
        assert f"manifest.{end}: other bytes, the same content" in report.lines[0]
        table.loc[0, "length_mm"] = 1.0
        table.to_csv(path, index=False) if end == "csv" else table.to_parquet(path)
        assert verify(once, content=True).wrong == 1
        path.write_bytes(before)


def test_content_is_held_against_the_labels(once):
    path = once / "flaws.parquet"
    table = pd.read_parquet(path)
    row = int(np.flatnonzero(table["pixels"])[0])
    table.loc[row, "pixels"] += 1
    table.to_parquet(path)
    lines = "\n".join(verify(once, content=True).lines)
    assert "pixels listed" in lines


@pytest.mark.parametrize(
    ("key", "value"),
    [("scans", None), ("scans", "x"), ("shards", []), ("shards", {"../x.h5": {"sha256": "0"}}),
     ("shards", {"a.h5": None}), ("recipe", None), ("classes", [1]), ("classes", {"x": "dent"}),
     ("files", None), ("versions", 3), ("name", 7)],
)  # fmt: skip
def test_a_description_of_another_shape_is_one_line(once, tmp_path, key, value):
    folder = tmp_path / "d"
    shutil.copytree(once, folder)
    said = json.loads((folder / "dataset.json").read_text())
    said[key] = value
    (folder / "dataset.json").write_text(json.dumps(said))
    with pytest.raises(RecipeError, match="dataset.json"):
        read_dataset(folder)


@pytest.mark.parametrize(
    "name", ["dataset.json", "checksums.sha256", "manifest.parquet", "shard-00000.h5", "a.lock"]
)
def test_a_pipe_in_a_dataset_is_never_waited_for(once, tmp_path, name):
    folder = tmp_path / "d"
    shutil.copytree(once, folder)
    (folder / name).unlink(missing_ok=True)
    os.mkfifo(folder / name)
    script = (
        "from pathlib import Path; from pipeline.dataset.verify import compare_with_lock, verify\n"
        f"folder = Path({str(folder)!r})\n"
        "for check in (verify, lambda folder: compare_with_lock(folder, folder / 'a.lock')):\n"
        "    try: print(*check(folder).lines, sep='\\n')\n"
        "    except ValueError as error: print(error)\n"
    )
    run = subprocess.run(
        [sys.executable, "-c", script], cwd=Path(__file__).parents[3], capture_output=True,
        text=True, timeout=120, check=True,
    )  # fmt: skip
    assert f"{name}: " in run.stdout
