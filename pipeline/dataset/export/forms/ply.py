"""Point clouds as binary PLY: the part frame, mm, colour, class and instance."""

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np

from files.whole_file import write_whole
from pipeline.dataset.export.cloud import class_colours, points_mm
from pipeline.dataset.export.source import Source

FIELDS: Final = {  # float, uchar and int alone: what every reader knows
    "x": "<f4", "y": "<f4", "z": "<f4", "red": "u1", "green": "u1", "blue": "u1",
    "label": "u1", "instance": "<i4",
}  # fmt: skip
NAMES: Final = {"<f4": "float", "u1": "uchar", "<i4": "int"}


def write(source: Source, out: Path) -> Iterator[Path]:
    """Write `SPLIT/ID.ply`."""
    table = class_colours(source.classes)
    for scan in source.scans():
        valid = np.isfinite(scan.depth_mm)
        points = points_mm(scan)[valid]
        label = scan.mask[valid]
        vertices = np.empty(len(points), dtype=list(FIELDS.items()))
        for axis, name in enumerate(("x", "y", "z")):
            vertices[name] = points[:, axis]
        for channel, name in enumerate(("red", "green", "blue")):
            vertices[name] = table[label, channel]
        vertices["label"], vertices["instance"] = label, scan.instance[valid]
        head = [
            "ply", "format binary_little_endian 1.0", f"comment {scan.scan_id}, part frame, mm",
            f"element vertex {len(points)}",
            *(f"property {NAMES[kind]} {name}" for name, kind in FIELDS.items()),
            "end_header",
        ]  # fmt: skip
        path = out / scan.split / f"{scan.scan_id}.ply"
        path.parent.mkdir(exist_ok=True)
        data = ("\n".join(head) + "\n").encode("ascii") + vertices.tobytes()
        write_whole(path, data, synced=False)
        yield path
