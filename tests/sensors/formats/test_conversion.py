"""From a height map to a recording: places, depths, what a user must say."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from files.errors import RecipeError
from sensors.formats import read_height_map
from sensors.formats.conversion import Imported, Setup, convert, nice_above, stack
from tests.support.exact_heights import heights, same, sick

Floats = NDArray[np.float64]


@pytest.fixture
def converted(tmp_path: Path) -> Callable[..., Imported]:
    def make(z: NDArray[Any], **words: Any) -> Imported:
        np.save(tmp_path / "z.npy", z)
        pitch = {"pitch_x_mm": 0.25, "pitch_y_mm": 0.5} | words
        return convert(read_height_map(tmp_path / "z.npy"), Setup(name="z", **pitch))

    return make


def test_points_stand_where_the_instrument_saw_them(converted: Callable[..., Imported]) -> None:
    """Pose · (x, 0, depth) is the instrument's (x, y, z), z up, for either direction of travel."""
    for backwards in (False, True):
        done = converted(heights(), backwards=backwards, working_distance_mm=64.0)
        recording = done.recording
        assert recording.x_mm is not None
        x = np.broadcast_to(recording.x_mm, recording.depth_mm.shape)
        ones = np.ones_like(x)
        seen = np.stack([x, 0 * x, recording.depth_mm, ones], axis=2)
        part = np.einsum("nij,nmj->nmi", recording.poses, seen)
        same(part[..., 2], heights())
        same(part[:, 0, 1], np.arange(7) * (-0.5 if backwards else 0.5))
        same(part[0, :, 0], recording.x_mm)
        assert np.linalg.det(recording.poses[0, :3, :3]) == 1.0
        assert (recording.poses[:, 2, 2] == -1.0).all()


def test_sensor_fits_the_recording(converted: Callable[..., Imported], tmp_path: Path) -> None:
    done = converted(heights(), rate_hz=200.0)
    depth, sensor = done.recording.depth_mm, done.sensor
    finite = depth[np.isfinite(depth)].astype(np.float32)
    assert finite.min() >= sensor.depth_min_mm
    assert finite.max() <= sensor.depth_max_mm
    assert sensor.x_fov_mm == 19 * 0.25
    assert sensor.travel_speed_mm_s == 0.5 * 200.0
    assert sensor.triangulation_angle_deg is None
    sensor.save(tmp_path / "s.yaml")
    assert type(sensor).load(tmp_path / "s.yaml") == sensor
    same(done.recording.time_s, np.arange(7) / 200.0)


def test_depths_are_taken_as_they_are(converted: Callable[..., Imported]) -> None:
    done = converted(heights() + 40.0, depth=True)
    same(done.recording.depth_mm, heights() + 40.0)
    with pytest.raises(RecipeError, match="--height"):
        converted(heights(), depth=True)


def test_repeated_rows_are_dropped_with_their_poses(converted: Callable[..., Imported]) -> None:
    z = heights()[[0, 1, 1, 1, 2, 3, 3]]
    done = converted(z)
    assert done.repeated == 3
    same(done.recording.poses[:, 1, 3], np.array([0.0, 0.5, 2.0, 2.5]))
    same(done.recording.time_s, np.array([0.0, 0.001, 0.004, 0.005]))
    assert "3 rows that repeated" in done.recording.comment
    kept = converted(z, keep_repeated=True)
    assert kept.repeated == 0
    assert kept.recording.depth_mm.shape == z.shape


def test_counts_and_missing_numbers(converted: Callable[..., Imported]) -> None:
    raw = np.random.default_rng(8).integers(1, 60000, (5, 16)).astype(np.uint16)
    raw[3, 3] = 0
    done = converted(raw, z_step_mm=0.002, missing=(0.0,), working_distance_mm=500.0)
    same(done.recording.depth_mm, 500.0 - np.where(raw == 0, np.nan, raw * 0.002))
    assert done.sensor.z_resolution_um == 2.0


def test_a_pitch_given_stretches_the_encoder(tmp_path: Path) -> None:
    entries = sick(np.arange(60).reshape(5, 12) + 1)
    entries[2]["data"]["MetaData"]["data"]["Content"][0]["Value"] = [0, 5, 10, 25, 30]
    (tmp_path / "s.json").write_text(json.dumps(entries))
    done = convert(read_height_map(tmp_path / "s.json"), Setup(name="s", pitch_y_mm=1.0))
    np.testing.assert_allclose(done.recording.poses[:, 1, 3] - 1.0, [0, 1, 2, 5, 6], atol=1e-9)


def test_profiles_stack(tmp_path: Path) -> None:
    maps = []
    for k in range(3):
        table = np.column_stack([np.arange(20) * 0.1, heights()[k + 3]])
        np.savetxt(tmp_path / f"{k}.csv", table, "%.17g", ",", header="x_mm,z_mm")
        maps.append(read_height_map(tmp_path / f"{k}.csv"))
    one = stack(maps)
    same(one.readings_mm, heights()[3:6])
    with pytest.raises(RecipeError, match="--pitch-y-mm"):
        convert(one, Setup(name="p"))
    assert convert(one, Setup(name="p", pitch_y_mm=0.5)).recording.depth_mm.shape == (3, 20)
    single = convert(maps[0], Setup(name="p"))
    assert single.recording.depth_mm.shape == (1, 20)
    np.savetxt(tmp_path / "3.csv", table + [0.01, 0.0], "%.17g", ",", header="x_mm,z_mm")
    wider = stack([maps[0], read_height_map(tmp_path / "3.csv")])
    assert wider.readings_mm.shape == (2, 40)
    same(wider.readings_mm[0, ::2], heights()[3])
    assert np.isnan(wider.readings_mm[0, 1::2]).all()
    same(wider.x_mm[1::2], np.arange(20) * 0.1 + 0.01)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ({"pitch_x_mm": None}, "--pitch-x-mm"),
        ({"pitch_y_mm": None}, "--pitch-y-mm"),
        ({"working_distance_mm": 1.0}, "--working-distance-mm"),
    ],
)
def test_what_the_user_must_say(
    converted: Callable[..., Imported], words: dict[str, Any], said: str
) -> None:
    with pytest.raises(RecipeError, match=said):
        converted(heights(), **words)


def test_nothing_measured(converted: Callable[..., Imported]) -> None:
    with pytest.raises(RecipeError, match="every point is missing"):
        converted(np.full((4, 5), np.nan))


@pytest.mark.parametrize(
    ("value", "wanted"), [(0.011, 0.02), (2.0, 2.0), (51.0, 100.0), (1e-4, 1e-4)]
)
def test_nice_numbers(value: float, wanted: float) -> None:
    assert nice_above(value) == wanted
