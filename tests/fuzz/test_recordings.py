"""Recordings, right or not, are read or answered in one line; nothing beside them is opened."""

import os
import warnings

import h5py
import numpy as np
import pytest
from hypothesis import example, given

from files.errors import RecipeError
from sensors.recording import Recording
from tests.fuzz import recordings
from tests.fuzz.effort import effort


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("recordings")


@effort(40)
@given(recordings.right())
def test_right_ones_are_read_as_written(folder, file):
    recordings.write(file, folder / "a.h5")
    found = Recording.load(folder / "a.h5")
    np.testing.assert_array_equal(found.depth_mm, file.entries["depth"].values)
    np.testing.assert_array_equal(found.poses, file.entries["pose"].values)
    assert (found.x_mm is None) == ("x" not in file.entries)
    found.save(folder / "b.h5")
    again = Recording.load(folder / "b.h5")
    np.testing.assert_array_equal(again.depth_mm, found.depth_mm.astype(np.float32))
    np.testing.assert_array_equal(again.time_s, found.time_s)
    assert again.start_time_s == found.start_time_s


@effort(80)
@given(recordings.changed())
@example(recordings.otherwise("version", np.inf))
@example(recordings.otherwise("pose", 1e308))
def test_others_are_answered(folder, file):
    recordings.write(file, folder / "c.h5")
    found, said = None, ""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            found = Recording.load(folder / "c.h5")
    except RecipeError as error:
        said = str(error)
    assert "\n" not in said
    assert (found is None) == bool(said.strip())
    ways = {entry.stored for entry in file.entries.values() if entry.values.size}
    if ways & {"external", "external link", "virtual", "declared"}:
        assert found is None


@pytest.mark.parametrize("way", ["external", "link"])
def test_a_pipe_behind_a_recording_is_never_opened(tmp_path, way):
    """It would wait for ever."""
    os.mkfifo(tmp_path / "pipe")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.attrs["format"] = "profilometer-recording"
        if way == "external":
            where = [(str(tmp_path / "pipe"), 0, 800)]
            file.create_dataset("depth", shape=(10, 10), dtype="f8", external=where)
        else:
            file["depth"] = h5py.ExternalLink(str(tmp_path / "pipe"), "/depth")
    with pytest.raises(RecipeError, match="/depth lies in another file"):
        Recording.load(tmp_path / "a.h5")
