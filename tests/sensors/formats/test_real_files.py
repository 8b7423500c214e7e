"""Files of real instruments: every value, against the file or an independent reader."""

import base64
import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from sensors.formats import read_height_map
from sensors.formats.conversion import Setup, convert
from tests.support.exact_heights import same

Floats = NDArray[np.float64]


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
