"""Datasets in an object store: the bytes of a folder, resumed, read where they lie."""

import pickle
from pathlib import Path

import numpy as np
import pytest

import flawforge
from files.errors import RecipeError
from files.place import names, place
from pipeline.batch.run import generate
from pipeline.dataset.checksums import NAME, own_files
from pipeline.dataset.export import export
from pipeline.dataset.object_store import staged
from pipeline.dataset.verify import verify
from pipeline.recipe import Recipe
from tests.support.small_recipe import write_shards

pytest.importorskip("upath", reason="universal-pathlib isn't installed: flawforge[s3]")


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> tuple[Recipe, Path]:
    """Return a recipe, and the folder of its dataset."""
    folder = tmp_path_factory.mktemp("folder")
    recipe = Recipe.load(write_shards(folder, specimens=3, scans=2))
    generate(recipe, folder / "out")
    return recipe, folder / "out"


def in_store(recipe: Recipe, url: str) -> Path:
    with staged(url) as (store, out):
        assert store is not None
        generate(recipe, out, store=store)
    return store


@pytest.fixture(scope="module")
def store(made) -> Path:
    return in_store(made[0], "memory://made/once/")


def content(at: Path) -> dict[str, bytes]:
    return {name: (at / name).read_bytes() for name in names(at)}


def of_folder(out: Path) -> dict[str, bytes]:
    return {name: (out / name).read_bytes() for name in (*own_files(out), NAME)}


def test_the_bytes_of_a_folder(made, store):
    assert content(store) == of_folder(made[1])


def test_a_folder_needs_no_staging(tmp_path):
    with staged(tmp_path / "a") as (store, out):
        assert (store, out) == (None, tmp_path / "a")
    with staged(f"file://{tmp_path}/a") as (store, out):
        assert (store, out) == (None, tmp_path / "a")


def test_a_run_continues_and_makes_what_is_damaged_anew(made, caplog):
    recipe, folder = made
    store = in_store(recipe, "memory://again/x")
    (store / "dataset.json").unlink()
    (store / "shard-00001.h5").write_bytes(b"cut off")
    (store / "shard-00002.h5").unlink()
    with caplog.at_level("INFO", logger="flawforge.generate"):
        in_store(recipe, "memory://again/x")
    shards = [one.facts for one in caplog.records if one.event == "shard"]
    assert {one["shard"] for one in shards if one["kept"]} == {"shard-00000.h5"}
    assert content(store) == of_folder(folder)


def test_a_prefix_of_something_else_is_refused(made, store):
    recipe, _ = made
    with pytest.raises(RecipeError, match="of another recipe"):
        in_store(Recipe.load(recipe.document.path, seed=99), str(store))
    letter = place("memory://mine/letter.txt")
    letter.write_bytes(b"x")
    with pytest.raises(RecipeError, match="isn't empty and holds no dataset"):
        in_store(recipe, "memory://mine")
    assert names(place("memory://mine")) == ["letter.txt"]


def test_a_failed_upload_is_one_line_and_the_run_continues(made, monkeypatch):
    recipe, folder = made
    upload, left = type(place("memory://down").fs).put_file, [5]

    def put_file(self, *words, **more):
        left[0] -= 1
        if left[0] < 0:
            raise ConnectionError("the line is down\nin two lines")
        return upload(self, *words, **more)

    monkeypatch.setattr(type(place("memory://down").fs), "put_file", put_file)
    with pytest.raises(RecipeError, match=r"memory://down/\S+: the object store .*line is down\)"):
        in_store(recipe, "memory://down")
    store = place("memory://down")
    assert "dataset.json" not in names(store)
    assert content(store).items() <= of_folder(folder).items()
    monkeypatch.undo()
    assert content(in_store(recipe, "memory://down")) == of_folder(folder)


def test_verify_reads_the_store(made, store):
    assert verify(store).lines == (f"{store}: 6 scans in 3 shards, all whole",)
    assert verify(store, content=True).wrong == 0
    hurt = in_store(made[0], "memory://hurt")
    body = (hurt / "shard-00001.h5").read_bytes()
    (hurt / "shard-00001.h5").write_bytes(body[:-1] + b"!")
    assert verify(hurt).lines[0].startswith("shard-00001.h5: damaged")


def test_the_reader_reads_the_store(made, store):
    here, there = flawforge.open(made[1]), flawforge.open(str(store))
    for scans in (there, pickle.loads(pickle.dumps(there))):
        assert len(scans) == len(here) == 6
        for name in ("depth", "mask", "pose"):
            np.testing.assert_array_equal(scans[4][name], here[4][name])
    assert there.info == here.info
    assert there.flaws.equals(here.flaws)


def test_export_reads_the_store(made, store, tmp_path):
    paths = export(made[1], tmp_path / "a", "coco"), export(str(store), tmp_path / "b", "coco")
    files = [{path.name: path.read_bytes() for path in some} for some in paths]
    assert files[0] == files[1]
    assert files[0]
