"""Files are there whole or as they were; links, devices and folders stay what they are."""

import os
import threading

import pytest

from files.whole_file import whole, write_whole


@pytest.mark.parametrize("synced", [False, True])
def test_a_file_is_replaced_or_as_it_was(tmp_path, synced):
    path = tmp_path / "a.yaml"
    write_whole(path, "one", synced=synced)
    write_whole(path, b"two", synced=synced)
    assert path.read_text() == "two"
    with pytest.raises(TypeError), whole(path, synced=synced) as aside:
        aside.write_text(aside)
    assert path.read_text() == "two"
    assert [one.name for one in tmp_path.iterdir()] == ["a.yaml"]


def test_a_link_stays_one(tmp_path):
    (tmp_path / "there").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "there" / "file")
    write_whole(tmp_path / "link", "text")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "there" / "file").read_text() == "text"


def test_a_pipe_is_written_into(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    got = []
    reader = threading.Thread(target=lambda: got.append((tmp_path / "pipe").read_text()))
    reader.start()
    write_whole(tmp_path / "pipe", "text", synced=False)
    reader.join(60.0)
    assert got == ["text"]
    assert (tmp_path / "pipe").is_fifo()


def test_folders_are_refused_by_name(tmp_path):
    with pytest.raises(IsADirectoryError, match="Is a directory"):
        write_whole(tmp_path, "text")
    with pytest.raises(FileNotFoundError) as fault:
        write_whole(tmp_path / "no" / "file", "text")
    assert fault.value.filename == str(tmp_path / "no" / "file")
