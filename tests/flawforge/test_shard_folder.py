"""Open shards of a folder: few at a time, and none shared with a fork or a pickle."""

import os
import pickle
from pathlib import Path

import h5py
import pytest

from flawforge.open_shard import ShardError
from flawforge.shard_folder import ShardFolder

NAMES = ("a.h5", "b.h5", "c.h5")


@pytest.fixture
def path(tmp_path: Path) -> Path:
    for name in NAMES:
        with h5py.File(tmp_path / name, "w") as file:
            file.attrs["format"] = "flawforge-shard"
            file["scan_id"] = [f"scan of {name}".encode()]
    return tmp_path


def test_a_shard_is_opened_once(path: Path) -> None:
    shards = ShardFolder(path)
    assert shards.opened == ()
    assert shards["a.h5"].names == ["scan of a.h5"]
    assert shards["a.h5"] is shards["a.h5"]
    with pytest.raises(ShardError, match=r"none\.h5: is missing"):
        shards["none.h5"]
    assert shards.opened == ("a.h5",)


def test_the_least_recently_used_is_closed(path: Path) -> None:
    shards = ShardFolder(path, most=2)
    first, second = shards["a.h5"], shards["b.h5"]
    assert shards["a.h5"] is first
    assert shards["c.h5"].names == ["scan of c.h5"]
    assert shards.opened == ("a.h5", "c.h5")
    assert first.file.id.valid
    assert not second.file.id.valid


def test_closed_shards_open_again(path: Path) -> None:
    shards = ShardFolder(path)
    before = shards["a.h5"]
    shards.close()
    assert shards.opened == ()
    assert not before.file.id.valid
    assert shards["a.h5"].names == ["scan of a.h5"]


def test_a_pickle_holds_no_open_file(path: Path) -> None:
    shards = ShardFolder(path)
    assert shards["a.h5"].names == ["scan of a.h5"]
    again = pickle.loads(pickle.dumps(shards))
    assert again.opened == ()
    assert again["a.h5"].names == ["scan of a.h5"]


def test_a_fork_opens_its_own_and_leaves_its_parent_s_open(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shards = ShardFolder(path)
    inherited = shards["a.h5"]
    monkeypatch.setattr(os, "getpid", lambda: -1)  # as a forked child finds it
    assert shards.opened == ()
    shards.close()
    assert shards["a.h5"] is not inherited
    assert inherited.file.id.valid
