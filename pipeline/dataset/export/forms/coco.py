"""COCO instance segmentation: pictures by split, annotations with compressed run lengths."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from pycocotools import mask as run_lengths

from files.whole_file import whole, write_whole
from pipeline.dataset.export.image import Coding
from pipeline.dataset.export.source import Labelled, Source, flaw_facts


def write(source: Source, out: Path) -> Iterator[Path]:
    """Write `SPLIT/ID.png` and `annotations/instances_SPLIT.json`; ids count from 1.

    A category's id is the class's number, the same in every dataset. Annotations go to disk scan
    by scan: memory holds one scan and a line for each picture.
    """
    coding = Coding.of(source)
    (out / "annotations").mkdir(exist_ok=True)
    for split in source.splits:
        (out / split).mkdir(exist_ok=True)
        path = out / "annotations" / f"instances_{split}.json"
        with whole(path) as aside, aside.open("w", encoding="utf-8") as file:
            yield from _split(source, split, coding, out / split, file)
        yield path


def _split(
    source: Source, split: str, coding: Coding, folder: Path, file: TextIO
) -> Iterator[Path]:
    info = {"description": f"{source.name}, split {split}", "image": coding.facts}
    categories = [
        {"id": number, "name": name, "supercategory": "flaw"}
        for number, name in source.classes.items()
    ]
    file.write(f'{{"info": {json.dumps(info)},\n"categories": {json.dumps(categories)},\n')
    file.write('"annotations": [')
    images: list[dict[str, Any]] = []
    count = 0
    for number, scan in enumerate(source.scans(split), start=1):
        path = folder / f"{scan.scan_id}{coding.suffix}"
        write_whole(path, coding.file(scan), synced=False)
        yield path
        height, width = scan.mask.shape
        images.append({"id": number, "file_name": path.name, "height": height, "width": width})
        for annotation in annotations(scan):
            count += 1
            text = json.dumps({"id": count, "image_id": number, **annotation}, allow_nan=False)
            file.write(("\n" if count == 1 else ",\n") + text)
    file.write("],\n" + f'"images": {json.dumps(images)}}}\n')


def annotations(scan: Labelled) -> Iterator[dict[str, Any]]:
    """COCO's keys for each flaw in a scan, ids left out."""
    for flaw in scan.flaws:
        here = scan.instance == int(flaw["instance"])
        coded = run_lengths.encode(np.asfortranarray(here, dtype=np.uint8))
        rows, columns = np.nonzero(here)
        left, top = int(columns.min()), int(rows.min())
        yield {
            "category_id": int(flaw["class_id"]),
            "segmentation": {"size": list(here.shape), "counts": coded["counts"].decode("ascii")},
            "area": int(here.sum()),
            "bbox": [left, top, int(columns.max()) - left + 1, int(rows.max()) - top + 1],
            "iscrowd": 0,
            "flaw_id": f"{scan.specimen}/{int(flaw['instance'])}",
            **flaw_facts(flaw),
        }
