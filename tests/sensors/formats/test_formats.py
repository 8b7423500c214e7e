"""Files of instruments: values come out as they went in, and damage is named."""

import base64
import json
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from sensors.formats import read_height_map
from sensors.formats.conversion import Imported, Setup, convert, nice_above, stack
from sensors.formats.pcd import lzf_unpack
from sensors.typed_yaml import RecipeError

Floats = NDArray[np.float64]


def heights(rows: int = 7, columns: int = 20) -> Floats:
    """Heights that float32 holds exactly, with a missing point."""
    z = np.random.default_rng(4).integers(-800, 900, (rows, columns)) / 256.0
    z[2, 3] = np.nan
    return z


def grid_points(z: Floats, pitch: tuple[float, float] = (0.25, 0.5)) -> Floats:
    x, y = np.meshgrid(np.arange(z.shape[1]) * pitch[0] - 2.0, np.arange(z.shape[0]) * pitch[1])
    return np.stack([x, y, z], axis=2)


def same(a: Floats | None, b: Floats) -> None:
    assert a is not None
    np.testing.assert_array_equal(a, b)


# --- tables, arrays, images


@pytest.mark.parametrize("separator", [",", ";", "\t", " "])
def test_matrix_of_text(tmp_path: Path, separator: str) -> None:
    path = tmp_path / "z.csv"
    np.savetxt(path, heights(), "%.17g", delimiter=separator)
    same(read_height_map(path).readings_mm, heights())
    same(read_height_map(path, "um").readings_mm, heights() * 1e-3)


def test_empty_cells_and_decimal_commas(tmp_path: Path) -> None:
    path = tmp_path / "z.csv"
    path.write_text("0,5;1,25;-2\n3;;0,75\n\n")
    same(read_height_map(path).readings_mm, np.array([[0.5, 1.25, -2.0], [3.0, np.nan, 0.75]]))


def test_profile_columns_have_units_in_their_names(tmp_path: Path) -> None:
    path = tmp_path / "p.csv"
    x, z = np.arange(20) * 1.5, np.random.default_rng(1).normal(size=(2, 20))
    np.savetxt(path, np.column_stack([x, *z]), "%.17g", ",", header="x [um],z1 (nm),z2 (nm)")
    found = read_height_map(path)
    same(found.readings_mm, z * 1e-6)
    same(found.x_mm, x * 1e-3)


def test_two_rising_columns_are_a_profile(tmp_path: Path) -> None:
    path = tmp_path / "p.txt"
    x, z = np.cumsum(np.linspace(0.1, 0.2, 30)), np.random.default_rng(1).normal(size=30)
    np.savetxt(path, np.column_stack([x, z]), "%.17g")
    found = read_height_map(path)
    same(found.readings_mm, z[None])
    same(found.x_mm, x)  # uneven places are kept


def test_rounded_positions_are_the_even_ones_they_stand_for(tmp_path: Path) -> None:
    path = tmp_path / "d.csv"
    lines = ["Stylus,Radius: 2.5 µm", "Length,1500.0 um", "", "Lateral um,Raw Micrometer,"]
    x = np.arange(100) * 0.156
    lines += [f"{a:.1f},{0.01 * k:.5f},," for k, a in enumerate(x)]
    path.write_bytes("\n".join(lines).encode("latin-1"))
    found = read_height_map(path)
    assert found.x_mm is not None
    np.testing.assert_allclose(found.x_mm, x * 1e-3, atol=5.1e-5)
    assert np.ptp(np.diff(found.x_mm)) < 1e-15
    np.testing.assert_allclose(found.readings_mm[0], np.arange(100) * 1e-5, atol=1e-18)


@pytest.mark.parametrize("named", [True, False])
def test_points_of_text_find_their_grid(tmp_path: Path, named: bool) -> None:
    path = tmp_path / "xyz.csv"
    points = grid_points(np.nan_to_num(heights())).reshape(-1, 3)
    shuffled = np.random.default_rng(0).permutation(points)
    np.savetxt(path, shuffled, "%.17g", ",", header="x,y,z" if named else "", comments="")
    found = read_height_map(path)
    same(found.readings_mm, np.nan_to_num(heights()))
    same(found.x_mm, points[:20, 0])


def test_npy(tmp_path: Path) -> None:
    np.save(tmp_path / "z.npy", heights())
    same(read_height_map(tmp_path / "z.npy").readings_mm, heights())
    np.save(tmp_path / "i.npy", np.arange(40, dtype=np.int32).reshape(4, 10))
    found = read_height_map(tmp_path / "i.npy", "um")
    same(found.readings_mm, np.arange(40.0).reshape(4, 10) * 1e-3)
    assert found.step_mm == 1e-3


@pytest.mark.parametrize("kind", ["uint8", "uint16", "float32"])
def test_tiff(tmp_path: Path, kind: str) -> None:
    z = np.random.default_rng(2).integers(0, 250, (6, 9)).astype(kind)
    z *= np.array(257, kind) if kind == "uint16" else np.array(1, kind)
    Image.fromarray(z).save(tmp_path / "z.tif")
    same(read_height_map(tmp_path / "z.tif").readings_mm, z.astype(float))


# --- point clouds


def write_ply(path: Path, points: Floats, form: str, words: str = "") -> None:
    head = f"ply\nformat {form} 1.0\n{words}element vertex {len(points)}\n"
    head += "".join(f"property float {k}\n" for k in ("x", "y", "z", "intensity")) + "end_header\n"
    values = np.column_stack([points, np.linspace(0, 255, len(points))])
    if form == "ascii":
        body = "\n".join(" ".join(f"{v:.9g}" for v in row) for row in values).encode()
    else:
        body = values.astype("<f4" if "little" in form else ">f4").tobytes()
    path.write_bytes(head.encode() + body)


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


# --- SICK, X3P, SUR, Excel


def sick(raw: NDArray[Any], endian: str = "big", step: int = 5) -> list[dict[str, Any]]:
    order = {"big": ">", "little": "<"}[endian]
    rows, columns = raw.shape

    def image(pixels: NDArray[Any], endian: str, z: float) -> dict[str, Any]:
        data = base64.b64encode(pixels.tobytes()).decode()
        kind = pixels.dtype.newbyteorder("=").name
        return {
            "class": "Image",
            "data": {
                "PixelSize": {"x": 0.1, "y": 0.2, "z": z},
                "Origin": {"x": -3.0, "y": 1.0, "z": 10.0},
                "HandleZeroPixels": "MissingData",
                "Data": {
                    "ImageType": kind,
                    "Width": columns,
                    "Height": rows,
                    "Pixels": {"endian": endian, "elemTypes": [kind], "data": data},
                },
            },
        }

    encoder = {"Key": "EncoderValue", "Value": [700 + step * k for k in range(rows)]}
    meta = {"FrameNo": 9, "MetaData": {"data": {"Content": [encoder]}}}
    return [
        image(raw.astype(order + "u2"), endian, 0.02),
        image((raw % 256).astype("u1"), "neutral", 1.0),
        {"class": "SensorData", "data": meta},
    ]


@pytest.mark.parametrize("endian", ["big", "little"])
def test_sick(tmp_path: Path, endian: str) -> None:
    raw = np.random.default_rng(3).integers(0, 9000, (5, 12))
    raw[1, 4] = 0
    (tmp_path / "s.json").write_text(json.dumps(sick(raw, endian)))
    found = read_height_map(tmp_path / "s.json")
    same(found.readings_mm, np.where(raw == 0, np.nan, raw * 0.02 + 10.0))
    same(found.x_mm, -3.0 + np.arange(12) * 0.1)
    np.testing.assert_allclose(found.y_mm, 1.0 + np.arange(5) * 0.2, atol=1e-12)
    same(found.intensity, (raw % 256) / 255.0)
    assert found.step_mm == 0.02


def test_sick_encoder_tells_where_rows_are(tmp_path: Path) -> None:
    entries = sick(np.arange(60).reshape(5, 12) + 1)
    content = entries[2]["data"]["MetaData"]["data"]["Content"][0]
    content["Value"] = [0, 5, 10, 25, 30]
    (tmp_path / "s.json").write_text(json.dumps(entries))
    found = read_height_map(tmp_path / "s.json")
    np.testing.assert_allclose(found.y_mm, [1.0, 1.2, 1.4, 2.0, 2.2], atol=1e-12)


def spoil_sick(how: str, entries: list[dict[str, Any]]) -> str:
    data = entries[0]["data"]["Data"]
    if how == "base64":
        data["Pixels"]["data"] = data["Pixels"]["data"][:-3]
    elif how == "size":
        data["Height"] += 1
    elif how == "encoder":
        entries[2]["data"]["MetaData"]["data"]["Content"][0]["Value"].pop()
    elif how == "key":
        del entries[0]["data"]["PixelSize"]
    elif how == "no height":
        del entries[0]
    text = json.dumps(entries)
    return text[: len(text) // 2] if how == "json" else text


@pytest.mark.parametrize(
    ("how", "said"),
    [
        ("base64", "damaged pixel data"),
        ("size", "another number of bytes"),
        ("encoder", "doesn't fit the rows"),
        ("key", "no 'PixelSize'"),
        ("no height", "no height image"),
        ("json", "isn't JSON"),
    ],
)
def test_damaged_sick_files(tmp_path: Path, how: str, said: str) -> None:
    (tmp_path / "s.json").write_text(spoil_sick(how, sick(np.ones((4, 5), dtype=int))))
    with pytest.raises(RecipeError, match=said) as caught:
        read_height_map(tmp_path / "s.json")
    assert "s.json" in str(caught.value)
    assert "\n" not in str(caught.value)


def write_x3p(path: Path, kind: str, body: bytes, shape: tuple[int, int], valid: bytes) -> None:
    text = f"""<?xml version="1.0"?><p:ISO5436_2 xmlns:p="http://x"><Record1>
    <FeatureType>SUR</FeatureType><Axes>
    <CX><AxisType>I</AxisType><Increment>1e-6</Increment><Offset>2e-6</Offset></CX>
    <CY><AxisType>I</AxisType><Increment>3e-6</Increment></CY>
    <CZ><AxisType>A</AxisType><DataType>{kind}</DataType><Increment>1e-9</Increment></CZ></Axes>
    </Record1><Record3><MatrixDimension><SizeX>{shape[1]}</SizeX><SizeY>{shape[0]}</SizeY>
    <SizeZ>1</SizeZ></MatrixDimension><DataLink><PointDataLink>bindata/data.bin</PointDataLink>
    {"<ValidPointsLink>bindata/valid.bin</ValidPointsLink>" if valid else ""}
    </DataLink></Record3></p:ISO5436_2>"""
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("main.xml", text)
        archive.writestr("bindata/data.bin", body)
        if valid:
            archive.writestr("bindata/valid.bin", valid)


@pytest.mark.parametrize(
    ("kind", "dtype"), [("I", "<i2"), ("L", "<i4"), ("F", "<f4"), ("D", "<f8")]
)
def test_x3p(tmp_path: Path, kind: str, dtype: str) -> None:
    raw = np.random.default_rng(5).integers(-900, 900, (4, 6)).astype(dtype)
    valid = np.ones(24, dtype=np.uint8)
    valid[7] = 0
    bits = np.packbits(valid, bitorder="little").tobytes()
    write_x3p(tmp_path / "t.x3p", kind, raw.tobytes(), (4, 6), bits)
    found = read_height_map(tmp_path / "t.x3p")
    wanted = raw.astype(float) * 1e-9 * 1e3
    wanted[1, 1] = np.nan
    np.testing.assert_allclose(found.readings_mm, wanted, rtol=1e-15)
    assert found.x_mm is not None
    np.testing.assert_allclose(found.x_mm[:2], [2e-3, 3e-3], rtol=1e-12)
    write_x3p(tmp_path / "short.x3p", kind, raw.tobytes()[:-1], (4, 6), b"")
    with pytest.raises(RecipeError, match="another number of bytes"):
        read_height_map(tmp_path / "short.x3p")


def sur(raw: NDArray[Any], inversion: int = 0, packed: bool = False) -> bytes:
    head = bytearray(512)
    head[:12] = b"DSCOMPRESSED" if packed else b"DIGITAL SURF"
    rows, columns = raw.shape
    bits = raw.dtype.itemsize * 8
    for kind, at, value in (
        ("h", 18, 2), ("h", 86, 1), ("h", 98, bits), ("i", 100, -500), ("i", 104, 500),
        ("i", 108, columns), ("i", 112, rows), ("f", 120, 0.5), ("f", 124, 0.25), ("f", 128, 0.125),
        ("h", 290, inversion),
    ):  # fmt: skip
        struct.pack_into("<" + kind, head, at, value)
    for at, unit in ((180, b"mm"), (196, b"\xb5m"), (212, b"\xe6m")):
        head[at : at + 16] = unit.ljust(16)
    body = raw.tobytes()
    if packed:
        parts = [zlib.compress(body[:10]), zlib.compress(body[10:])]
        sizes = (2, 10, len(parts[0]), len(body) - 10, len(parts[1]))
        body = struct.pack("<5i", *sizes) + b"".join(parts)
    return bytes(head) + body


@pytest.mark.parametrize("dtype", ["<i2", "<i4"])
@pytest.mark.parametrize("packed", [False, True])
def test_sur(tmp_path: Path, dtype: str, packed: bool) -> None:
    raw = np.random.default_rng(6).integers(-500, 500, (4, 6)).astype(dtype)
    raw[0, 2] = -502  # not measured
    wanted = raw * 0.125e-3
    wanted[0, 2] = np.nan
    (tmp_path / "s.sur").write_bytes(sur(raw, packed=packed))
    found = read_height_map(tmp_path / "s.sur")
    np.testing.assert_allclose(found.readings_mm, wanted, rtol=1e-15)
    same(found.x_mm, np.arange(6) * 0.5)
    np.testing.assert_allclose(found.y_mm, np.arange(4) * 0.25e-3, atol=1e-18)
    (tmp_path / "i.sur").write_bytes(sur(raw, inversion=2))
    np.testing.assert_allclose(
        read_height_map(tmp_path / "i.sur").readings_mm, -wanted[:, ::-1], rtol=1e-15
    )
    (tmp_path / "s.sur").write_bytes(sur(raw, packed=packed)[:-9])
    with pytest.raises(RecipeError, match=r"ends early|damaged"):
        read_height_map(tmp_path / "s.sur")


def test_excel_table(tmp_path: Path) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.append(["x_mm", "z_um"])
    for k in range(20):
        book.active.append([0.25 * k, 0.5 * k * k])
    book.save(tmp_path / "t.xlsx")
    found = read_height_map(tmp_path / "t.xlsx")
    same(found.x_mm, np.arange(20) * 0.25)
    same(found.readings_mm[0], 0.5 * np.arange(20.0) ** 2 * 1e-3)


# --- bad input


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.foo", b"", "unknown format"),
        ("a.csv", b"", "is empty"),
        ("a.csv", b"alpha,beta\ngamma,delta\n", "no numbers"),
        ("a.csv", b"1,2,3\n4,x,6\n", r"a\.csv:2: isn't a row of numbers"),
        ("a.csv", b"1,x,3\n4,5,6\n", r"a\.csv:1: isn't a row of numbers"),
        ("a.csv", b"1,2,3\n4,5\n", r"a\.csv:2: has rows of different lengths, got 2"),
        ("a.csv", b"x,z\n1,2\n1,3\n", "don't rise"),
        ("a.npy", b"nonsense", "isn't an array"),
        ("a.tif", b"nonsense", "isn't a TIFF"),
        ("a.ply", b"nonsense", "isn't a PLY"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 9\nproperty float x\n", "damaged"),
        ("a.pcd", b"nonsense", "isn't a PCD"),
        ("a.json", b"{}", "isn't a SICK"),
        ("a.json", b"[3]", "isn't a SICK"),
        ("a.x3p", b"nonsense", "isn't an X3P"),
        ("a.sur", b"nonsense", "isn't a SUR"),
        ("a.sur", b"DIGITAL SURF", "ends within its header"),
        ("a.xlsx", b"nonsense", "isn't an Excel"),
    ],
)
def test_bad_files_give_one_line(tmp_path: Path, name: str, content: bytes, said: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(RecipeError, match=said) as caught:
        read_height_map(tmp_path / name)
    assert name in str(caught.value)
    with pytest.raises(RecipeError, match="no such file"):
        read_height_map(tmp_path / "none.csv")


def test_unknown_unit(tmp_path: Path) -> None:
    np.save(tmp_path / "z.npy", heights())
    with pytest.raises(RecipeError, match="unknown unit"):
        read_height_map(tmp_path / "z.npy", "furlong")


# --- conversion


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


# --- real files


@pytest.mark.parametrize(
    ("name", "rows", "columns", "repeated"),
    [
        ("BlobFeatureTypes3D_image", 770, 744, 0),
        ("EdgeMatcher3D_teachImages", 808, 800, 0),
        ("OCR_3D_image_34", 989, 648, 225),
        ("OCR_3D_image_42", 500, 648, 0),
        ("StripGroove_image_9", 550, 648, 79),
        ("VisualizeHeightmap_image_21", 673, 1248, 278),  # 29 more repeat a blank row
    ],
)
def test_real_height_maps(
    shared_dir: Path, name: str, rows: int, columns: int, repeated: int
) -> None:
    path = shared_dir / "real" / "sick" / f"{name}.json"
    found = read_height_map(path)
    assert found.readings_mm.shape == (rows, columns)
    done = convert(found, Setup(name=name))
    assert done.repeated == repeated
    image = json.loads(path.read_text())[0]["data"]
    pixels, size = image["Data"]["Pixels"], image["PixelSize"]
    order = ">" if pixels["endian"] == "big" else "<"
    raw = np.frombuffer(base64.b64decode(pixels["data"]), order + "u2").reshape(rows, columns)
    whole = convert(found, Setup(name=name, keep_repeated=True)).recording
    wanted = done.sensor.working_distance_mm - np.where(raw == 0, np.nan, raw * size["z"])
    same(whole.depth_mm, wanted)
    assert whole.intensity is not None
    assert (whole.intensity[raw == 0] == 0.0).all()
    assert whole.intensity.max() == 1.0


def test_real_topographies(shared_dir: Path) -> None:
    """Against an independent reader."""
    reader = pytest.importorskip("SurfaceTopography")
    folder = shared_dir / "real" / "roughness"
    for name in ("x3p-2.x3p", "sur-2.sur"):
        found = read_height_map(folder / name)
        theirs = reader.open_topography(folder / name).topography().to_unit("mm")
        wanted = np.ma.filled(theirs.heights().astype(float), np.nan).T
        np.testing.assert_allclose(found.readings_mm, wanted, rtol=1e-7)
        assert found.x_mm is not None
        np.testing.assert_allclose(found.x_mm[1] - found.x_mm[0], theirs.pixel_size[0], rtol=1e-6)
    sheet = read_height_map(folder / "mitutoyo_2_mock.xlsx")
    table = np.loadtxt(folder / "mitutoyo_2_profile_x_mm_z_um.csv", delimiter=",")
    same(sheet.x_mm, table[:, 0])
    np.testing.assert_allclose(sheet.readings_mm[0], table[:, 1] * 1e-3, rtol=1e-15)
    dektak = read_height_map(folder / "dektak-1.csv")
    assert dektak.readings_mm.shape == (1, 9600)
    assert dektak.readings_mm[0, 0] == -0.00933 * 1e-3
    assert dektak.x_mm is not None
    assert dektak.x_mm[-1] == pytest.approx(1.4998)
