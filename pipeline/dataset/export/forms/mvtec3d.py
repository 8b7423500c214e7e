"""Anomaly detection in the folders of MVTec 3D-AD (Bergmann et al., VISAPP 2022)."""

import csv
import io
import logging
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
import tifffile

from files.whole_file import whole, write_whole
from pipeline.dataset.export.cloud import points_mm
from pipeline.dataset.export.image import Coding, encoded
from pipeline.dataset.export.source import Labelled, Source

LOG = logging.getLogger("flawforge.export")
FOLDERS: Final = {"train": "train", "val": "validation", "validation": "validation"}


def write(source: Source, out: Path) -> Iterator[Path]:
    """Write `PART/{train,validation,test}/{good,KIND,combined}/{rgb,xyz,gt}/000` and `scans.csv`.

    rgb: local relief, grey as RGB PNG; xyz: part frame, mm, float32 TIFF, missing = 0, 0, 0; gt:
    0 or 255. Training and validation hold good scans alone, as the original does; their flawed
    scans are left out. Splits other than train and val are tests.
    """
    coding = Coding.of(replace(source, image="relief8"))
    rows: list[tuple[str, str]] = []
    counts: Counter[str] = Counter()
    left_out = 0
    for scan in source.scans():
        split, kind = FOLDERS.get(scan.split, "test"), _kind(scan)
        if split != "test" and kind != "good":
            left_out += 1
            continue
        folder = f"{scan.part}/{split}/{kind}"
        number = f"{counts[folder]:03d}"
        counts[folder] += 1
        rows.append((f"{folder}/rgb/{number}.png", scan.scan_id))
        xyz = np.nan_to_num(points_mm(scan), nan=0.0).astype(np.float32)
        grey = coding.array(scan)
        pictures = {
            "rgb": np.repeat(grey[..., None], 3, axis=2),
            "gt": np.where(scan.mask > 0, 255, 0).astype(np.uint8),
        }
        for name, array in pictures.items():
            path = out / folder / name / f"{number}.png"
            path.parent.mkdir(parents=True, exist_ok=True)
            write_whole(path, encoded(array), synced=False)
            yield path
        path = out / folder / "xyz" / f"{number}.tiff"
        path.parent.mkdir(exist_ok=True)
        with whole(path) as aside:
            tifffile.imwrite(aside, xyz, photometric="rgb", software="flawforge", metadata=None)
        yield path
    text = io.StringIO(newline="")
    csv.writer(text, lineterminator="\n").writerows([("file", "scan_id"), *rows])
    write_whole(out / "scans.csv", text.getvalue(), synced=False)
    yield out / "scans.csv"
    for line in _warnings(source, counts, left_out):
        LOG.warning(line, extra={"event": "warning", "facts": {"text": line}})


def _kind(scan: Labelled) -> str:
    kinds = {str(flaw["kind"]) for flaw in scan.flaws}
    return "good" if not kinds else kinds.pop() if len(kinds) == 1 else "combined"


def _warnings(source: Source, counts: Counter[str], left_out: int) -> Iterator[str]:
    if left_out:
        yield f"{left_out} flawed scans of train and val are left out: these hold good scans alone"
    for part in dict.fromkeys(source.manifest["part"]):
        if not counts[f"{part}/train/good"]:
            yield f"{part}: no good scan to train on; the recipe's good_specimens makes them"
