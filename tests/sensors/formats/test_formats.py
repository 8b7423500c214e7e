"""Files of instruments: values come out as they went in, and damage is named."""

import json
import struct
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from files.errors import RecipeError
from sensors.formats import read_height_map
from tests.support.exact_heights import grid_points, heights, same, sick


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
