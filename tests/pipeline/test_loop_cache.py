"""Where compiled loops are kept, and that nobody else can put any there."""

import os

import pytest

from pipeline.loop_cache import VARIABLE, keep_loops


@pytest.fixture
def homeless(tmp_path, monkeypatch):
    """Neither an installation nor a home that can be written; a temporary folder is there."""
    monkeypatch.setenv(VARIABLE, "")  # so that it is as before afterwards
    monkeypatch.delenv(VARIABLE)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    (tmp_path / "home").write_text("no folder")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    return tmp_path


def test_a_folder_of_ones_own(homeless):
    keep_loops(homeless / "nowhere")
    folder = homeless / f"flawforge-loops-{os.getuid()}"
    assert os.environ[VARIABLE] == str(folder)
    assert folder.stat().st_mode & 0o777 == 0o700


def test_a_folder_that_others_can_write_is_not_taken(homeless):
    folder = homeless / f"flawforge-loops-{os.getuid()}"
    folder.mkdir()
    folder.chmod(0o777)
    keep_loops(homeless / "nowhere")
    assert os.environ[VARIABLE] != str(folder)
    assert os.environ[VARIABLE].startswith(str(folder.parent))


def test_a_link_is_not_taken(homeless):
    folder = homeless / f"flawforge-loops-{os.getuid()}"
    (homeless / "theirs").mkdir()
    folder.symlink_to(homeless / "theirs")
    keep_loops(homeless / "nowhere")
    assert os.environ[VARIABLE] not in (str(folder), str(homeless / "theirs"))


def test_numba_chooses_where_it_can(homeless, monkeypatch):
    keep_loops(homeless)  # beside the source
    assert VARIABLE not in os.environ
    monkeypatch.setenv("HOME", str(homeless))
    keep_loops(homeless / "nowhere")  # in the user's cache
    assert VARIABLE not in os.environ
    monkeypatch.setenv(VARIABLE, "mine")
    monkeypatch.setenv("HOME", str(homeless / "home"))
    keep_loops(homeless / "nowhere")
    assert os.environ[VARIABLE] == "mine"


def test_nothing_can_be_written(homeless, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(homeless / "home"))
    keep_loops(homeless / "nowhere")
    assert VARIABLE not in os.environ
