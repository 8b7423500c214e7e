"""Height maps of other programs land on their own grid, reading for reading."""

import argparse
import json
from pathlib import Path

import numpy as np
import pytest

from flawforge.import_command import add_arguments, run
from sensors.recording import Recording
from sensors.recording_formats import read_height_map
from sensors.typed_yaml import RecipeError

HEIGHT = np.round(np.random.default_rng(3).normal(5, 1, (4, 5)), 3)
HEIGHT[1, 2] = np.nan


def do_import(*words: str) -> None:
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    assert run(parser.parse_args(words)) == 0


def points() -> np.ndarray:
    y, x = np.meshgrid(np.arange(4) * 0.5, np.arange(5) * 0.2, indexing="ij")
    return np.stack([x.ravel(), y.ravel(), HEIGHT.ravel()], axis=1)


def write(path: Path) -> None:
    table = points()
    if path.suffix == ".csv":
        path.write_text("\n".join(";".join(f"{v}".replace(".", ",") for v in r) for r in HEIGHT))
    elif path.suffix == ".npy":
        np.save(path, HEIGHT)
    elif path.suffix == ".tif":
        from PIL import Image

        Image.fromarray(HEIGHT.astype(np.float32)).save(path)
    elif path.suffix == ".ply":
        head = (
            "ply\nformat binary_little_endian 1.0\nobj_info num_cols 5\nobj_info num_rows 4\n"
            "element vertex 20\nproperty double x\nproperty double y\nproperty double z\nend_header\n"
        )
        path.write_bytes(head.encode() + table.astype("<f8").tobytes())
    else:
        head = (
            "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 5\nHEIGHT 4\n"
            "POINTS 20\nDATA ascii\n"
        )
        path.write_text(head + "\n".join(" ".join(map(str, row)) for row in table))


@pytest.mark.parametrize("suffix", ["csv", "npy", "tif", "ply", "pcd"])
def test_readings_keep_their_places(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"map.{suffix}"
    write(path)
    grid = read_height_map(path)
    np.testing.assert_allclose(grid.values, HEIGHT, rtol=1e-6)
    if suffix in ("ply", "pcd"):
        assert grid.pitch_x == pytest.approx(0.2)
        assert grid.pitch_y == pytest.approx(0.5)


def test_import_places_heights_in_the_part_frame(tmp_path: Path) -> None:
    np.save(tmp_path / "map.npy", HEIGHT * 1000)
    out = tmp_path / "r.h5"
    do_import(str(tmp_path / "map.npy"), "--as", str(out), "--unit", "um", "--pitch-x", "0.2",
              "--pitch-y", "0.5", "--standoff", "90")  # fmt: skip
    got = Recording.load(out)
    assert got.x_mm is not None
    local = np.stack([np.broadcast_to(got.x_mm, (4, 5)), np.zeros((4, 5)), got.depth_mm], axis=-1)
    placed = np.einsum("nij,nmj->nmi", got.poses[:, :3, :3], local) + got.poses[:, None, :3, 3]
    np.testing.assert_allclose(placed[..., 2], HEIGHT, atol=1e-5)
    np.testing.assert_allclose(placed[..., 1], np.arange(4)[:, None] * 0.5 * np.ones(5))
    np.testing.assert_allclose(np.diff(placed[..., 0], axis=1), 0.2)


def test_a_missing_pitch_is_asked_for(tmp_path: Path) -> None:
    np.save(tmp_path / "map.npy", HEIGHT)
    with pytest.raises(RecipeError, match="--pitch-x"):
        do_import(str(tmp_path / "map.npy"), "--as", str(tmp_path / "r.h5"))


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.csv", "1,2,3\n4,5\n"), ("b.csv", ""), ("c.npy", "no"), ("d.json", "{}"),
        ("e.tif", "no"), ("f.ply", "ply"), ("g.pcd", "VERSION"), ("h.xyz", "1 2 3"),
        ("i.json", json.dumps([{"class": "Image", "data": {}}])),
    ],
)  # fmt: skip
def test_damaged_files_are_named_in_one_line(tmp_path: Path, name: str, content: str) -> None:
    (tmp_path / name).write_text(content)
    with pytest.raises(RecipeError, match=name) as caught:
        read_height_map(tmp_path / name)
    assert "\n" not in str(caught.value)


def test_points_off_a_grid_are_refused(tmp_path: Path) -> None:
    table = points()
    table[7, 0] += 0.06
    (tmp_path / "p.pcd").write_text(
        "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 20\nHEIGHT 1\nDATA ascii\n"
        + "\n".join(" ".join(map(str, row)) for row in table)
    )
    with pytest.raises(RecipeError, match="never resampled"):
        read_height_map(tmp_path / "p.pcd")


def test_real_sick_images(shared_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = shared_dir / "real" / "sick" / "StripGroove_image_9.json"
    grid = read_height_map(source)
    assert grid.values.shape == (550, 648)
    assert grid.pitch_x == pytest.approx(0.1011851355433464)
    assert grid.intensity is not None
    assert 0 <= np.nanmin(grid.intensity) <= np.nanmax(grid.intensity) <= 1
    assert grid.rows is not None
    assert np.all(np.diff(grid.rows) > 0)
    do_import(str(source), "--as", str(tmp_path / "r.h5"))
    # the folder's README counts the repeated rows
    assert "79 profiles repeat" in capsys.readouterr().out
    assert Recording.load(tmp_path / "r.h5").depth_mm.shape[0] == 550 - 79
