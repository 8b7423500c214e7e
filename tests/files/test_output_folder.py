"""Folders of results that a failure leaves as they were."""

from pathlib import Path

import pytest

from files.output_folder import output_folder


def test_what_was_made_for_nothing_is_removed(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no"), output_folder(tmp_path / "a" / "b"):
        raise ValueError("no")
    assert list(tmp_path.iterdir()) == []


def test_what_was_there_and_what_was_written_stays(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    with pytest.raises(ValueError, match="no"), output_folder(tmp_path / "a"):
        raise ValueError("no")
    assert (tmp_path / "a").is_dir()
    with pytest.raises(NotADirectoryError), output_folder(tmp_path / "b" / "c") as folder:
        _touched(folder / "half").iterdir().__next__()
    assert (tmp_path / "b" / "c" / "half").is_file()


def _touched(path: Path) -> Path:
    path.touch()
    return path


def test_work_that_ends_keeps_its_folder(tmp_path: Path) -> None:
    with output_folder(tmp_path / "a" / "b") as folder:
        pass
    assert folder.is_dir()


def test_a_folder_that_cannot_be_made_fails_first(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match="file"), output_folder(tmp_path / "file" / "a"):
        pytest.fail("no work")  # pragma: no cover
