"""Disks that are full or read-only, and folders that go: one line, exit code 2, nothing lost."""

import json
import logging
import os
import shutil
from pathlib import Path

import pytest

from flawforge.cli import main
from pipeline.dataset.checksums import own_files
from tests.support.mounts import read_only, resize, small_disk
from tests.support.small_recipe import write_shards


@pytest.fixture(scope="module")
def recipe(tmp_path_factory):
    return write_shards(tmp_path_factory.mktemp("recipe"))


@pytest.fixture(scope="module")
def whole(recipe, tmp_path_factory):
    out = tmp_path_factory.mktemp("whole") / "out"
    assert main(["generate", str(recipe), "--out", str(out)]) == 0
    return out


def contents(folder: Path) -> dict[str, bytes]:
    return {name: (folder / name).read_bytes() for name in own_files(folder)}


def one_line(capsys) -> str:
    """Return what went to standard error beside progress: a single line."""
    said = capsys.readouterr().err.splitlines()
    errors = [line for line in said if line.startswith("flawforge: ")]
    assert len(errors) == 1, said
    assert "Traceback" not in "".join(said)
    assert "an error of ours" not in errors[0]
    return errors[0]


@pytest.mark.slow
def test_a_disk_that_is_full_at_every_size(recipe, whole, tmp_path, capsys):
    """The disk grows by a page's worth at a time; then the run goes on to the same bytes."""
    wanted, full = contents(whole), 0
    for kib in (4, 8, 12, 16, 24, 32, 48, 64, 80, 96, 112, 128, 160, 192, 224, 256, 4096):
        with small_disk(tmp_path / f"disk-{kib}", kib) as disk:
            words = ["generate", str(recipe), "--out", str(disk / "out")]
            capsys.readouterr()
            code = main(words)
            assert code in (0, 2)
            if code == 2:
                full += 1
                assert "No space left on device" in one_line(capsys)
                assert not list(disk.rglob("*.part*"))
                resize(disk, 16384)
                assert main(words) == 0
            assert contents(disk / "out") == wanted
    assert full > 8
    assert code == 0


@pytest.mark.parametrize(
    "words",
    [
        ["export", "WHOLE", "--to", "coco", "--out", "DISK/e"],
        ["export", "WHOLE", "--to", "recording", "--out", "DISK/e"],
        ["export", "WHOLE", "--to", "tiff", "--out", "DISK/e"],
        ["export", "WHOLE", "--to", "webdataset", "--out", "DISK/e"],
        ["export", "WHOLE", "--to", "ply", "--out", "DISK/e"],
        ["export", "WHOLE", "--to", "mvtec3d", "--out", "DISK/e"],
        ["view", "WHOLE", "--out", "DISK/page.html"],
        ["verify", "WHOLE", "--lock", "DISK/a.lock", "--write"],
        ["preview", "WHOLE", "--out", "DISK/scan.png"],
        ["schema", "--out", "DISK/schema.json"],
    ],
    ids=lambda words: " ".join(words[:1] + words[2:4]),
)
def test_each_command_on_a_full_and_on_a_read_only_disk(words, whole, tmp_path, capsys):
    def answered(disk: Path) -> str:
        here = [w.replace("WHOLE", str(whole)).replace("DISK", str(disk)) for w in words]
        assert main(here) == 2
        return one_line(capsys)

    with small_disk(tmp_path / "full", 4) as disk:
        (disk / "filler").write_bytes(bytes(4096))
        assert "No space left on device" in answered(disk)
        assert [path for path in disk.rglob("*") if path.is_file()] == [disk / "filler"]
    (tmp_path / "folder").mkdir()
    with read_only(tmp_path / "folder", tmp_path / "ro") as disk:
        assert "Read-only file system" in answered(disk)


def test_generate_into_a_read_only_folder(recipe, tmp_path, capsys):
    (tmp_path / "folder").mkdir()
    with read_only(tmp_path / "folder", tmp_path / "ro") as disk:
        assert main(["generate", str(recipe), "--out", str(disk / "out")]) == 2
        assert "can't be written (Read-only file system)" in one_line(capsys)


class AtFirstShard(logging.Handler):
    """Does something as soon as a shard is finished."""

    def __init__(self, act) -> None:
        super().__init__()
        self.act = act

    def emit(self, record: logging.LogRecord) -> None:
        if record.__dict__.get("event") == "shard" and self.act is not None:
            act, self.act = self.act, None
            act()


@pytest.fixture
def at_first_shard():
    log, handlers = logging.getLogger("flawforge.generate"), []

    def set_act(act):
        handlers.append(AtFirstShard(act))
        log.addHandler(handlers[-1])

    yield set_act
    for handler in handlers:
        log.removeHandler(handler)


def elsewhere(out: Path, target: Path) -> None:
    out.rename(out.with_name("moved"))
    out.symlink_to(target)


@pytest.mark.parametrize("json_lines", [False, True])
def test_the_folder_goes_midway(recipe, whole, tmp_path, capsys, at_first_shard, json_lines):
    out = tmp_path / "out"
    words = ["generate", str(recipe), "--out", str(out), *(["--log-json"] if json_lines else [])]
    at_first_shard(lambda: shutil.rmtree(out))
    assert main(words) == 2
    captured = capsys.readouterr()
    assert captured.err.count("flawforge: ") == 1
    assert "No such file or directory" in captured.err
    if json_lines:
        events = [json.loads(line)["event"] for line in captured.out.splitlines()]
        assert "shard" in events
    assert main(words) == 0
    assert contents(out) == contents(whole)


def test_the_folder_becomes_a_link_midway(recipe, tmp_path, capsys, at_first_shard):
    """One line; what lies where the link leads stays as it is."""
    out, target = tmp_path / "out", tmp_path / "target"
    target.mkdir()
    (target / "shard-00000.h5").write_text("mine")
    at_first_shard(lambda: elsewhere(out, target))
    assert main(["generate", str(recipe), "--out", str(out)]) == 2
    one_line(capsys)
    assert (target / "shard-00000.h5").read_text() == "mine"


@pytest.mark.parametrize(
    ("umask", "file", "folder"), [(0o077, 0o600, 0o700), (0o022, 0o644, 0o755)]
)
def test_modes_are_what_the_umask_leaves(recipe, tmp_path, umask, file, folder):
    before = os.umask(umask)
    try:
        assert main(["generate", str(recipe), "--out", str(tmp_path / "out")]) == 0
        for form in ("coco", "recording", "webdataset", "tiff"):
            words = ["export", str(tmp_path / "out"), "--to", form, "--out", str(tmp_path / form)]
            assert main(words) == 0
        assert main(["view", str(tmp_path / "out"), "--out", str(tmp_path / "page.html")]) == 0
    finally:
        os.umask(before)
    for path in tmp_path.rglob("*"):
        wanted = folder if path.is_dir() else file
        assert path.stat().st_mode & 0o777 == wanted, path
