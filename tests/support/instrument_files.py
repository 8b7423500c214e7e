"""A small file of each instrument's format: a plate with a step and noise."""

import io
import json
import struct
import zipfile

import numpy as np
import tifffile
from PIL import Image


def heights(rng: np.random.Generator, rows: int = 24, columns: int = 30) -> np.ndarray:
    """Return a plate with a step of 1 mm and noise of 10 µm, (rows, columns) mm, four decimals."""
    step = (np.arange(columns) >= columns // 2) * 1.0
    return np.round(20.0 + step + 0.01 * rng.normal(size=(rows, columns)), 4)


def plate(rows: int = 24, columns: int = 30, seed: int = 0) -> np.ndarray:
    """Return the heights of one such plate."""
    return heights(np.random.default_rng(seed), rows, columns)


def files(rng: np.random.Generator) -> dict[str, bytes]:
    """Return a small file of each format."""
    z = heights(rng)
    y, x = np.meshgrid(0.2 * np.arange(24), 0.2 * np.arange(30), indexing="ij")
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    made: dict[str, bytes] = {}
    made["a.csv"] = "\n".join(",".join(f"{v:.4f}" for v in row) for row in z).encode()
    made["b.csv"] = b"x_mm,y_mm,z_mm\n" + "\n".join(
        ",".join(f"{v:.4f}" for v in row) for row in points
    ).encode()
    buffer = io.BytesIO()
    np.save(buffer, z.astype(np.float32))
    made["a.npy"] = buffer.getvalue()
    buffer = io.BytesIO()
    tifffile.imwrite(buffer, z.astype(np.float32))
    made["a.tif"] = buffer.getvalue()
    buffer = io.BytesIO()
    Image.fromarray((z * 1000).astype(np.uint16)).save(buffer, "PNG")
    made["a.png"] = buffer.getvalue()
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    head += "property float x\nproperty float y\nproperty float z\nend_header\n"
    made["a.ply"] = head.encode() + points.astype("<f4").tobytes()
    grid = f"obj_info num_cols 30\nobj_info num_rows 24\nelement vertex {len(points)}\n"
    made["b.ply"] = (
        f"ply\nformat ascii 1.0\n{grid}property float x\nproperty float y\nproperty float z\n"
        f"element range_grid {len(points)}\nproperty list uchar int vertex_indices\nend_header\n"
        + "\n".join(" ".join(f"{v:.4f}" for v in row) for row in points)
        + "\n" + "\n".join(f"1 {k}" for k in range(len(points))) + "\n"
    ).encode()  # fmt: skip
    made["a.pcd"] = (
        "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 30\nHEIGHT 24\n"
        f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(points)}\nDATA binary\n"
    ).encode() + points.astype("<f4").tobytes()
    head_sdf = b"bISO-1.0" + b"MAKER".ljust(10) + b"011120261200" * 2
    head_sdf += struct.pack("<HHdddd", 30, 24, 1e-4, 2e-4, 1e-5, 1e-6)
    made["a.sdf"] = head_sdf + struct.pack("<bbb", 0, 7, 0) + (z * 100).astype("<f8").tobytes()
    bcr = "fileformat = bcrf\nheadersize = 2048\nxpixels = 30\nypixels = 24\nxlength = 3000\n"
    bcr += "ylength = 2400\nbit2nm = 2\nintelmode = 1\n"
    made["a.bcrf"] = bcr.encode().ljust(2048, b"\0") + (z * 100).astype("<f4").tobytes()
    made["a.x3p"] = _x3p(z)
    made["a.xlsx"] = _xlsx(z)
    made["a.json"] = _sick(z)
    return made


def _x3p(z: np.ndarray) -> bytes:
    axes = "".join(
        f"<{axis}><AxisType>{'A' if axis == 'CZ' else 'I'}</AxisType><DataType>D</DataType>"
        f"<Increment>2e-4</Increment><Offset>0</Offset></{axis}>" for axis in ("CX", "CY", "CZ")
    )  # fmt: skip
    body = (
        '<?xml version="1.0" encoding="UTF-8"?><p:ISO5436_2 xmlns:p="x"><Record1><FeatureType>SUR'
        f"</FeatureType><Axes>{axes}</Axes></Record1><Record3><MatrixDimension><SizeX>30</SizeX>"
        "<SizeY>24</SizeY><SizeZ>1</SizeZ></MatrixDimension><DataLink><PointDataLink>bindata/data.bin"
        "</PointDataLink></DataLink></Record3></p:ISO5436_2>"
    )
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("main.xml", body)
        archive.writestr("bindata/data.bin", (z * 1e-3).astype("<f8").tobytes())
    return buffer.getvalue()


def _xlsx(z: np.ndarray) -> bytes:
    main = 'xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"'
    relation = 'xmlns:r="http://schemas.openxmlformats.org/officeDocument/2006/relationships"'
    rows = "".join(
        "<row>" + "".join(f"<c><v>{v:.4f}</v></c>" for v in row) + "</row>" for row in z
    )
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(
            "xl/workbook.xml",
            f'<workbook {main} {relation}><sheets><sheet name="S" r:id="r1"/></sheets></workbook>',
        )
        archive.writestr(
            "xl/_rels/workbook.xml.rels",
            '<Relationships><Relationship Id="r1" Target="worksheets/sheet1.xml"/></Relationships>',
        )
        archive.writestr(
            "xl/worksheets/sheet1.xml",
            f"<worksheet {main}><sheetData>{rows}</sheetData></worksheet>",
        )
    return buffer.getvalue()


def _sick(z: np.ndarray) -> bytes:
    import base64

    raw = (z * 1000).astype("<u2")
    pixels = {"data": base64.b64encode(raw.tobytes()).decode(), "elemTypes": ["uint16"],
              "endian": "little"}  # fmt: skip
    image = {"class": "Image", "data": {"Data": {"Width": 30, "Height": 24, "ImageType": "uint16",
             "Pixels": pixels},
             "PixelSize": {"x": 0.2, "y": 0.2, "z": 0.001}, "Origin": {"x": 0, "y": 0, "z": 0},
             "HandleZeroPixels": "MissingData"}}  # fmt: skip
    return json.dumps([image]).encode()
