"""Point clouds: PLY, PCD and text give their grid back."""

import struct
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from files.errors import RecipeError
from sensors.formats import read_height_map
from sensors.formats.clouds.pcd import lzf_unpack
from tests.support.exact_heights import grid_points, heights, same

Floats = NDArray[np.float64]


def write_ply(path: Path, points: Floats, form: str, words: str = "") -> None:
    head = f"ply\nformat {form} 1.0\n{words}element vertex {len(points)}\n"
    head += "".join(f"property float {k}\n" for k in ("x", "y", "z", "intensity")) + "end_header\n"
    values = np.column_stack([points, np.linspace(0, 255, len(points))])
    if form == "ascii":
        body = "\n".join(" ".join(f"{v:.9g}" for v in row) for row in values).encode()
    else:
        body = values.astype("<f4" if "little" in form else ">f4").tobytes()
    path.write_bytes(head.encode() + body)


def pack_lzf(raw: bytes) -> bytes:
    """LZF of literals, and of the one copy that a run of equal bytes allows."""
    out, at = bytearray(), 0
    while at < len(raw):
        run = 1
        while at + run < len(raw) and raw[at + run] == raw[at] and run < 200:
            run += 1
        if run > 12:
            out += bytes([0, raw[at], 7 << 5, run - 1 - 9, 0])
            at += run
        else:
            piece = raw[at : at + min(run, 32)]
            out += bytes([len(piece) - 1]) + piece
            at += len(piece)
    return bytes(out)


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("words", ["", "obj_info num_cols 20\nobj_info num_rows 7\n"])
def test_ply(tmp_path: Path, form: str, words: str) -> None:
    path = tmp_path / "p.ply"
    points = grid_points(heights())
    if not words:  # unordered, the missing point left out
        keep = np.isfinite(points[..., 2])
        write_ply(path, points[keep], form)
    else:
        write_ply(path, points.reshape(-1, 3), form, words)
    found = read_height_map(path)
    same(found.readings_mm, heights())
    same(found.x_mm, points[0, :, 0])
    same(found.y_mm, points[:, 0, 1])
    assert found.intensity is not None
    assert found.intensity.max() == 1.0


def test_ply_range_grid(tmp_path: Path) -> None:
    points = grid_points(heights())
    keep = np.isfinite(points[..., 2]).ravel()
    index = np.where(keep, np.cumsum(keep) - 1, -1)
    head = (
        f"ply\nformat binary_big_endian 1.0\nobj_info num_cols 20\nobj_info num_rows 7\n"
        f"element vertex {keep.sum()}\nproperty double x\nproperty double y\nproperty double z\n"
        "element range_grid 140\nproperty list uchar int vertex_indices\nend_header\n"
    )
    lists = b"".join(struct.pack(">Bi", 1, i) if i >= 0 else b"\0" for i in index)
    body = points.reshape(-1, 3)[keep].astype(">f8").tobytes() + lists
    (tmp_path / "r.ply").write_bytes(head.encode() + body)
    same(read_height_map(tmp_path / "r.ply").readings_mm, heights())


@pytest.mark.parametrize("form", ["ascii", "binary", "binary_compressed"])
@pytest.mark.parametrize("turned", [False, True])
def test_pcd(tmp_path: Path, form: str, turned: bool) -> None:
    """Also where the file runs along the travel first."""
    points = grid_points(heights())
    order = points.transpose(1, 0, 2) if turned else points
    flat = order.reshape(-1, 3).astype("<f4")
    table = np.zeros(len(flat), dtype=[(k, "<f4") for k in "xyzi"])
    for k, name in enumerate("xyz"):
        table[name] = flat[:, k]
    head = (
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z _\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\n"
        f"WIDTH {order.shape[1]}\nHEIGHT {order.shape[0]}\nVIEWPOINT 0 0 0 1 0 0 0\n"
        f"POINTS {len(flat)}\nDATA {form}\n"
    ).encode()
    if form == "ascii":
        body = "\n".join(" ".join(f"{v:.9g}" for v in (*row, 0)) for row in flat).encode()
    elif form == "binary":
        body = table.tobytes()
    else:
        raw = b"".join(table[name].tobytes() for name in "xyzi")
        packed = pack_lzf(raw)
        body = struct.pack("<II", len(packed), len(raw)) + packed
    (tmp_path / "p.pcd").write_bytes(head + body)
    found = read_height_map(tmp_path / "p.pcd")
    same(found.readings_mm, heights())
    same(found.x_mm, points[0, :, 0])


def test_lzf_copies_that_overlap_themselves() -> None:
    assert lzf_unpack(bytes([1, 65, 66, 0x40 + 0x20, 1]), 7) == b"ABABABA"
    with pytest.raises(ValueError, match="before the start"):
        lzf_unpack(bytes([0, 65, 0x20, 9]), 4)


def test_a_fan_of_rays_is_refused(tmp_path: Path) -> None:
    points = grid_points(np.nan_to_num(heights()))
    points[..., 0] *= 1.0 + points[..., 2] / 100.0
    words = "obj_info num_cols 20\nobj_info num_rows 7\n"
    write_ply(tmp_path / "fan.ply", points.reshape(-1, 3), "ascii", words)
    with pytest.raises(RecipeError, match=r"columns that aren't straight.*nothing is resampled"):
        read_height_map(tmp_path / "fan.ply")
    write_ply(tmp_path / "cloud.ply", points.reshape(-1, 3), "ascii")
    with pytest.raises(RecipeError, match="on no grid"):
        read_height_map(tmp_path / "cloud.ply")
