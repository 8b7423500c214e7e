"""Depth in mm as float32 TIFF with the scan's pitch, as ImageJ and GDAL read it."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import tifffile
from numpy.typing import NDArray

from files.whole_file import whole
from pipeline.dataset.export.source import Source
from pipeline.dataset.export.texts import write_json
from pipeline.dataset.relief import pitch_mm

GDAL_NODATA = 42113  # tag of GDAL: the value of missing readings, as text


def write(source: Source, out: Path) -> Iterator[Path]:
    """Write `SPLIT/{depth,mask,instance}/ID.tiff` and `classes.json`; depth NaN = missing.

    Resolution tags hold points per centimetre along the line and profiles per centimetre along
    the path, at the scan's median depth.
    """
    yield write_json(out / "classes.json", {"0": "background", **source.classes})
    for scan in source.scans():
        along_path, along_line = pitch_mm(scan.arrays)
        nodata = (GDAL_NODATA, "s", 0, "nan", True)
        files: dict[str, tuple[NDArray[Any], list[Any]]] = {
            "depth": (scan.depth_mm.astype(np.float32), [nodata]),
            "mask": (scan.mask, []),
            "instance": (scan.instance.astype(np.uint16), []),
        }
        for name, (array, tags) in files.items():
            path = out / scan.split / name / f"{scan.scan_id}.tiff"
            path.parent.mkdir(parents=True, exist_ok=True)
            with whole(path) as aside:
                tifffile.imwrite(
                    aside,
                    array,
                    photometric="minisblack",
                    resolution=(_per_cm(along_line), _per_cm(along_path)),
                    resolutionunit="CENTIMETER",
                    extratags=tags,
                    software="flawforge",
                    metadata=None,
                )
            yield path


def _per_cm(pitch: float) -> float:
    return 10.0 / pitch if math.isfinite(pitch) and pitch > 0 else 1.0
