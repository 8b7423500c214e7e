"""A folder for the Hugging Face hub: parquet files by split and a dataset card."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from files.whole_file import whole, write_whole
from files.yaml_document import dump_yaml
from pipeline.dataset.export.image import Coding, encoded
from pipeline.dataset.export.source import Labelled, Source, flaw_facts
from pipeline.dataset.markdown import as_text

SCANS_PER_FILE: Final = 256
SPLITS: Final = {"val": "validation"}  # as the hub names it
IMAGE: Final = pa.struct([("bytes", pa.binary()), ("path", pa.string())])
OBJECTS: Final = pa.struct(
    [
        ("id", pa.list_(pa.int64())),
        ("bbox", pa.list_(pa.list_(pa.float32(), 4))),
        ("category", pa.list_(pa.int64())),
        ("area", pa.list_(pa.int64())),
        ("depth_mm", pa.list_(pa.float64())),
        ("snr", pa.list_(pa.float64())),
    ]
)
COLUMNS: Final = {
    "image": IMAGE, "mask": IMAGE, "instance": IMAGE, "objects": OBJECTS,
    "scan_id": pa.string(), "part": pa.string(), "specimen": pa.string(),
    "width": pa.int64(), "height": pa.int64(),
}  # fmt: skip


def write(source: Source, out: Path) -> Iterator[Path]:
    """Write `data/SPLIT-00000-of-00001.parquet` ..., and README.md.

    `image` is a picture as chosen, `mask` 8-bit classes, `instance` 16-bit; `objects` holds lists
    over the flaws: bbox as x, y, width, height in points, category counted from 0.
    """
    coding = Coding.of(source)
    names = list(source.classes.values())
    features = {"info": {"features": _features(names)}}
    schema = pa.schema(COLUMNS.items(), metadata={"huggingface": json.dumps(features)})
    (out / "data").mkdir(exist_ok=True)
    sizes: dict[str, int] = {}
    for split, count in source.splits.items():
        scans = source.scans(split)
        files = -(-count // SCANS_PER_FILE)
        name = SPLITS.get(split, split)
        sizes[name] = count
        for number in range(files):
            path = out / "data" / f"{name}-{number:05d}-of-{files:05d}.parquet"
            with whole(path) as aside, pq.ParquetWriter(aside, schema) as writer:
                for _, scan in zip(range(SCANS_PER_FILE), scans, strict=False):
                    row = _row(scan, coding, list(source.classes))
                    writer.write_table(pa.Table.from_pylist([row], schema=schema))
            yield path
    write_whole(out / "README.md", _card(source, coding, names, sizes), synced=False)
    yield out / "README.md"


def _row(scan: Labelled, coding: Coding, classes: list[int]) -> dict[str, Any]:
    height, width = scan.mask.shape
    objects: dict[str, list[Any]] = {field.name: [] for field in OBJECTS}
    for flaw in scan.flaws:
        here = scan.instance == int(flaw["instance"])
        rows, columns = np.nonzero(here)
        left, top = int(columns.min()), int(rows.min())
        facts = flaw_facts(flaw)
        objects["id"].append(int(flaw["instance"]))
        objects["bbox"].append(
            [left, top, int(columns.max()) - left + 1, int(rows.max()) - top + 1]
        )
        objects["category"].append(classes.index(int(flaw["class_id"])))
        objects["area"].append(int(here.sum()))
        objects["depth_mm"].append(facts.get("depth_mm"))
        objects["snr"].append(facts.get("snr"))
    pictures = {
        "image": (coding.file(scan), coding.suffix),
        "mask": (encoded(scan.mask), ".png"),
        "instance": (encoded(scan.instance.astype(np.uint16)), ".png"),
    }
    return {
        **{
            name: {"bytes": data, "path": f"{scan.scan_id}{suffix}"}
            for name, (data, suffix) in pictures.items()
        },
        "objects": objects,
        "scan_id": scan.scan_id,
        "part": scan.part,
        "specimen": scan.specimen,
        "width": width,
        "height": height,
    }


def _features(names: list[str]) -> dict[str, Any]:
    """Return the features as the `datasets` library keeps them in a parquet file's metadata."""

    def value(kind: str) -> dict[str, str]:
        return {"dtype": kind, "_type": "Value"}

    def listed(feature: Any, length: int = -1) -> dict[str, Any]:
        return {"feature": feature, "length": length, "_type": "List"}

    return {
        **{name: {"_type": "Image"} for name in ("image", "mask", "instance")},
        "objects": {
            "id": listed(value("int64")),
            "bbox": listed(listed(value("float32"), 4)),
            "category": listed({"names": names, "_type": "ClassLabel"}),
            "area": listed(value("int64")),
            "depth_mm": listed(value("float64")),
            "snr": listed(value("float64")),
        },
        **{name: value("string") for name in ("scan_id", "part", "specimen")},
        **{name: value("int64") for name in ("width", "height")},
    }


def _card(source: Source, coding: Coding, names: list[str], sizes: dict[str, int]) -> str:
    head = {
        "pretty_name": source.name,
        "task_categories": ["image-segmentation", "object-detection"],
        "tags": ["surface-inspection", "laser-profilometer", "synthetic"],
        "configs": [
            {
                "config_name": "default",
                "data_files": [{"split": n, "path": f"data/{n}-*"} for n in sizes],
            }
        ],
    }
    rows = "\n".join(f"| {name} | {count} |" for name, count in sizes.items())
    classes = "\n".join(f"- {at}: {as_text(name)}" for at, name in enumerate(names))
    sensor = as_text(source.datasheet.name)
    facts = "\n".join(f"- {key}: {value}" for key, value in coding.facts.items())
    return f"""---
{dump_yaml(head)}---

# {as_text(source.name)}

Simulated laser-profilometer scans of flawed parts, generated by flawforge from a recipe (seed
{source.info["seed"]}, sensor {sensor}). Labels are exact: they follow from the
solids that were cut.

| split | scans |
| --- | --- |
{rows}

`image`:

{facts}

`mask` holds the class counted from 1 (0 = none), `instance` the flaw's number on its specimen.
`objects.category` counts from 0:

{classes}
"""
