"""recording.h5: what is written comes back, and what contradicts itself is refused in one line."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from files.errors import RecipeError
from sensors.recording import Recording, repeated_rows


def recording(**changes: object) -> Recording:
    rng = np.random.default_rng(1)
    depth = 100 + rng.normal(0, 0.01, (6, 9))
    depth[2, 3] = np.nan
    values: dict[str, object] = {
        "name": "a",
        "depth_mm": depth,
        "poses": np.tile(np.eye(4), (6, 1, 1)),
        "time_s": np.arange(6) * 0.1,
    }
    return Recording(**{**values, **changes})  # type: ignore[arg-type]


def test_what_is_saved_comes_back(tmp_path: Path) -> None:
    before = recording(
        intensity=np.linspace(0, 1, 54).reshape(6, 9),
        x_mm=np.linspace(-4, 4, 9),
        comment="warm",
        start_time_s=12.5,
    )
    before.save(tmp_path / "r.h5")
    after = Recording.load(tmp_path / "r.h5")
    np.testing.assert_array_equal(after.depth_mm, before.depth_mm.astype(np.float32))
    np.testing.assert_array_equal(after.poses, before.poses)
    np.testing.assert_array_equal(after.x_mm, before.x_mm)
    assert (after.name, after.comment, after.start_time_s) == ("a", "warm", 12.5)


def test_file_stem_names_a_nameless_recording(tmp_path: Path) -> None:
    recording(name="").save(tmp_path / "left door.h5")
    assert Recording.load(tmp_path / "left door.h5").name == "left door"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"depth_mm": np.full((6, 9), np.nan)}, "every point is NaN"),
        ({"depth_mm": np.zeros((6, 8)), "x_mm": np.arange(9.0)}, "/x doesn't fit"),
        ({"poses": np.tile(np.eye(4), (5, 1, 1))}, "/pose doesn't fit"),
        ({"poses": 2 * np.tile(np.eye(4), (6, 1, 1))}, "isn't rigid"),
        ({"poses": np.tile(np.diag([1.0, 1, -1, 1]), (6, 1, 1))}, "mirrors"),
        ({"time_s": np.arange(6)[::-1] * 0.1}, "never run backwards"),
        ({"x_mm": np.array([0, 1, 1, 2, 3, 4, 5, 6, 7.0])}, "strictly monotone"),
    ],
)
def test_contradictions_are_refused_in_one_line(changes: dict[str, object], words: str) -> None:
    with pytest.raises(RecipeError, match=words) as caught:
        recording(**changes)
    assert "\n" not in str(caught.value)


def test_files_that_are_no_recording(tmp_path: Path) -> None:
    (tmp_path / "text.h5").write_text("not HDF5")
    with pytest.raises(RecipeError, match=r"text\.h5: .*; flawforge import makes a recording"):
        Recording.load(tmp_path / "text.h5")
    with pytest.raises(RecipeError, match="gone.h5"):
        Recording.load(tmp_path / "gone.h5")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["depth"] = np.zeros((3, 3))
    with pytest.raises(RecipeError, match=r"isn't a recording, .*; flawforge import makes"):
        Recording.load(tmp_path / "other.h5")


def test_the_error_of_a_shard_says_how_it_becomes_a_recording(small_dataset: Path) -> None:
    with pytest.raises(RecipeError, match=r"; flawforge export DATASET --to recording makes"):
        Recording.load(next(small_dataset.glob("*.h5")))


def test_repeated_profiles_are_marked_but_blank_ones_are_not() -> None:
    depth = 100 + np.random.default_rng(2).normal(0, 0.01, (6, 20))
    depth[3] = depth[2]
    depth[5] = depth[4] = np.nan
    np.testing.assert_array_equal(repeated_rows(depth), [False, False, False, True, False, False])
