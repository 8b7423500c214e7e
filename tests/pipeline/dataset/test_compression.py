"""A recipe chooses how its shards are compressed; contents never differ, needs are stated."""

import importlib.util
import json
import shutil
import sys

import h5py
import pytest

import flawforge.dataset
from files.errors import RecipeError
from flawforge.cli import main
from flawforge.dataset import ShardError
from pipeline.batch.run import generate
from pipeline.dataset.compression import reader_needs
from pipeline.dataset.verify import verify
from pipeline.recipe import Recipe
from tests.support.tiny_recipe import write_recipe

ONE = ["specimens=1", "scans=2", "splits={train: 1.0}"]
FILTERS = {"deflate": 1, "zstd": 32015, "lz4": 32004}  # numbers that The HDF Group registered


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("compressed")
    recipe = write_recipe(folder / "recipe")
    for name in ("deflate", "zstd", "lz4", "none"):
        sets = [*ONE, f"compression={name}"]
        generate(Recipe.load(recipe, sets=sets), folder / name)
    return folder


@pytest.mark.parametrize("name", ["zstd", "lz4", "none"])
def test_the_same_scans_in_another_compression(made, name):
    one, other = (flawforge.dataset.open(made / key) for key in ("deflate", name))
    assert list(one.manifest["checksum"]) == list(other.manifest["checksum"])
    assert verify(made / name, content=True).wrong == 0
    with h5py.File(made / name / "shard-00000.h5") as file:
        held = dict(file["depth"]._filters)
    assert str(FILTERS.get(name)) in held if name in FILTERS else not held


def test_the_same_bytes_again(made, recipe_path):
    again = made / "again"
    generate(Recipe.load(recipe_path, sets=[*ONE, "compression=zstd"]), again)
    for shard in ("shard-00000.h5", "shard-00001.h5"):
        assert (again / shard).read_bytes() == (made / "zstd" / shard).read_bytes()


def test_the_dataset_names_what_a_reader_needs(made):
    for name in ("deflate", "zstd", "lz4", "none"):
        said = json.loads((made / name / "dataset.json").read_text())
        assert said["reader_needs"] == reader_needs(name)
        assert (said["reader_needs"] is not None) == (name in ("zstd", "lz4"))
        assert ("hdf5plugin" in said["versions"]) == (name in ("zstd", "lz4"))
        readme = (made / name / "README.md").read_text()
        assert ("pip install hdf5plugin" in readme) == (name in ("zstd", "lz4"))
        with h5py.File(made / name / "shard-00000.h5") as file:
            assert file.attrs.get("reader_needs") == reader_needs(name)


def test_a_reader_without_the_plugin_is_told_so(made, monkeypatch):
    monkeypatch.setitem(sys.modules, "hdf5plugin", None)
    with pytest.raises(ShardError, match=r"shard-00000\.h5: needs hdf5plugin: pip install"):
        flawforge.dataset.open(made / "zstd")[0]
    assert verify(made / "zstd").wrong == 0  # bytes and tables need no filter
    faults = verify(made / "zstd", content=True)
    assert "shard-00000.h5: can't be read (needs hdf5plugin" in faults.lines[0]
    assert flawforge.dataset.open(made / "none")[0]["depth"].shape == (40, 80)


def test_a_recipe_without_the_plugin_is_refused(recipe_path, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(RecipeError, match=r"lz4.*pip install 'flawforge\[hdf5plugin\]'"):
        Recipe.load(recipe_path, sets=["compression=lz4"])


def test_a_shard_that_leads_elsewhere_is_not_followed(small_dataset, tmp_path, capsys):
    shutil.copytree(small_dataset, tmp_path / "d")
    shard = tmp_path / "d" / "shard-00000.h5"
    with h5py.File(shard, "r+") as file:
        del file["depth"]
        file["depth"] = h5py.ExternalLink("/dev/zero", "/depth")
    for words in (["verify", "--content"], ["export", "--to", "png", "--out", str(tmp_path / "e")]):
        assert main([words[0], str(tmp_path / "d"), *words[1:]]) in (1, 2)
        printed = capsys.readouterr()
        assert "shard-00000.h5" in printed.out + printed.err
        assert "'depth' lies in another file" in printed.out + printed.err
    with pytest.raises(ShardError, match="'depth' lies in another file"):
        flawforge.dataset.open(tmp_path / "d")[0]["depth"]
