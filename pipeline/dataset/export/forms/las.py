"""Point clouds as LAS 1.4: metres, `classification` the class, `instance` an extra dimension."""

import datetime
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import laspy
import numpy as np

from files.whole_file import whole
from pipeline.dataset.export.cloud import points_mm
from pipeline.dataset.export.source import Source

SCALE_M: Final = 1e-7  # 0.1 µm, as finely as shards hold noise-free depths
DAY_ZERO: Final = datetime.date(1970, 1, 1)  # the same bytes on any day


def write(source: Source, out: Path) -> Iterator[Path]:
    """Write `SPLIT/ID.las`."""
    for scan in source.scans():
        header = laspy.LasHeader(version="1.4", point_format=6)
        header.add_extra_dim(laspy.ExtraBytesParams(name="instance", type=np.int32))
        header.scales = np.full(3, SCALE_M)
        header.creation_date = DAY_ZERO
        header.generating_software = "flawforge"
        header.system_identifier = "simulated profilometer"
        valid = np.isfinite(scan.depth_mm)
        points = points_mm(scan)[valid] * 1e-3
        header.offsets = np.floor(points.min(axis=0)) if len(points) else np.zeros(3)
        cloud = laspy.LasData(header)
        cloud.x, cloud.y, cloud.z = points.T
        cloud.classification = scan.mask[valid]
        cloud.instance = scan.instance[valid]
        cloud.gps_time = np.broadcast_to(scan.arrays["time"][:, None], valid.shape)[valid]
        path = out / scan.split / f"{scan.scan_id}.las"
        path.parent.mkdir(exist_ok=True)
        with whole(path) as aside:
            cloud.write(str(aside))
        yield path
