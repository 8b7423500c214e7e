"""Heights that float32 holds exactly, as points and as a file of SICK's."""

import base64
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
