"""Recorded poses: what a robot wrote is what the sensor follows, interpolated, never padded."""

import h5py
import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from files.errors import RecipeError
from pipeline.batch.run import generate
from pipeline.motion.recorded_path import replay
from pipeline.motion.trajectory import frame
from pipeline.recipe import Recipe

DOWN = frame((0, 0, -1), (0, 1, 0))


def recorded(count, *, turn_deg=0.0):
    share = np.linspace(0, 1, count)
    poses = np.tile(np.eye(4), (count, 1, 1))
    turns = Rotation.from_matrix(DOWN) * Rotation.from_rotvec(
        np.radians(turn_deg) * share[:, None] * [0, 0, 1]
    )
    poses[:, :3, :3] = turns.as_matrix()
    poses[:, 1, 3] = -12 + 24 * share
    poses[:, 2, 3] = 105
    return poses


def write_csv(path, poses, time_s=None):
    quaternion = Rotation.from_matrix(poses[:, :3, :3]).as_quat()
    table = pd.DataFrame(
        np.hstack([poses[:, :3, 3], quaternion]),
        columns=["x_mm", "y_mm", "z_mm", "qx", "qy", "qz", "qw"],
    )
    if time_s is not None:
        table.insert(0, "time_s", time_s)
    table.to_csv(path, index=False)


def write_h5(path, poses, time_s=None):
    with h5py.File(path, "w") as file:
        file["pose"] = poses
        if time_s is not None:
            file["time"] = time_s


@pytest.mark.parametrize(("end", "write"), [("csv", write_csv), ("h5", write_h5)])
def test_poses_come_back_as_recorded(tmp_path, end, write):
    poses, time_s = recorded(50, turn_deg=30), 7.0 + np.arange(50) ** 1.1 / 1000
    write(tmp_path / f"p.{end}", poses, time_s)
    way = replay(str(tmp_path / f"p.{end}"), 1000.0, 50)
    np.testing.assert_allclose(way.poses, poses, atol=1e-12)
    np.testing.assert_allclose(way.time_s, time_s - 7.0, atol=1e-12)


def test_between_poses_the_path_is_straight_and_turns_evenly(tmp_path):
    write_h5(tmp_path / "p.h5", recorded(2, turn_deg=40), np.array([0.0, 0.1]))
    way = replay(str(tmp_path / "p.h5"), 1000.0, 101)
    np.testing.assert_allclose(np.diff(way.poses[:, 1, 3]), 0.24, rtol=1e-9)
    half = Rotation.from_matrix(DOWN.T @ way.poses[50, :3, :3]).magnitude()
    assert np.degrees(half) == pytest.approx(20)
    assert way.facts["length_mm"] == pytest.approx(24)


def test_what_is_not_a_path_is_said_in_one_line(tmp_path):
    place = tmp_path / "p.h5"

    def refuses(match, profiles=101):
        with pytest.raises(RecipeError, match=match):
            replay(str(place), 1000.0, profiles)

    refuses("no such file")
    write_h5(place, recorded(11), np.linspace(0, 0.05, 11))
    refuses("51 of 101 profiles fit")
    place = tmp_path / "q.h5"
    write_h5(place, recorded(11))
    refuses("as many poses as profiles")
    place = tmp_path / "r.h5"
    bent = recorded(11)
    bent[3, 0, 0] *= 1.1
    write_h5(place, bent)
    refuses("pose 3 isn't rigid", 11)
    place = tmp_path / "s.h5"
    write_h5(place, recorded(11), np.zeros(11))
    refuses("times must rise", 11)
    place = tmp_path / "t.csv"
    place.write_text("x_mm,y_mm\n1,2\n3,4\n")
    refuses("columns are missing", 2)


def test_a_recipe_follows_its_file_and_knows_it_by_checksum(recipe_path, tmp_path):
    write_csv(recipe_path.parent / "robot.csv", recorded(40, turn_deg=3), np.arange(40) / 1000)
    sets = ["motion={path: robot.csv}", "specimens=1", "scans=1", "splits={train: 1.0}"]
    dataset = generate(Recipe.load(recipe_path, sets=sets), tmp_path / "out")
    assert dataset["scans"] == 2
    assert {"a motion", "b motion"} <= {*dataset["files"]}
    with h5py.File(tmp_path / "out" / "shard-00000.h5") as shard:
        np.testing.assert_allclose(shard["pose"][0], recorded(40, turn_deg=3), atol=1e-9)
    with pytest.raises(RecipeError, match="outside"):
        Recipe.load(recipe_path, sets=["motion={path: ../robot.csv}"])
    with pytest.raises(RecipeError, match="path"):
        Recipe.load(recipe_path, sets=["motion={path: robot.txt}"])
