"""Description of a dataset: croissant.json for machines, README.md for readers.

Croissant is the metadata format of MLCommons (https://docs.mlcommons.org/croissant/, version 1.0).
Both files depend on the dataset only: no date, no path, the same bytes on a rebuild.
"""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

from files.whole_file import write_whole
from files.yaml_document import dump_yaml
from pipeline.dataset.manifest import FLAW_COLUMNS, SCAN_COLUMNS
from pipeline.dataset.markdown import as_code, as_text
from pipeline.dataset.shards import file_sha256

Columns = Mapping[str, type]

COLUMNS: Final[Mapping[str, Columns]] = {"manifest": SCAN_COLUMNS, "flaws": FLAW_COLUMNS}
TYPES: Final = {str: "sc:Text", int: "sc:Integer", float: "sc:Float", bool: "sc:Boolean"}
TABLES: Final = {
    "manifest": "a row for each scan",
    "flaws": "a row for each flaw of a scan's specimen, seen in the scan or not",
}
CONTEXT: Final = {
    "@language": "en", "@vocab": "https://schema.org/", "sc": "https://schema.org/",
    "cr": "http://mlcommons.org/croissant/", "dct": "http://purl.org/dc/terms/",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "citeAs": "cr:citeAs", "column": "cr:column", "conformsTo": "dct:conformsTo",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "examples": {"@id": "cr:examples", "@type": "@json"},
    "extract": "cr:extract", "field": "cr:field", "fileObject": "cr:fileObject",
    "fileProperty": "cr:fileProperty", "fileSet": "cr:fileSet", "format": "cr:format",
    "includes": "cr:includes", "isLiveDataset": "cr:isLiveDataset", "jsonPath": "cr:jsonPath",
    "key": "cr:key", "md5": "cr:md5", "parentField": "cr:parentField", "path": "cr:path",
    "recordSet": "cr:recordSet", "references": "cr:references", "regex": "cr:regex",
    "repeated": "cr:repeated", "replace": "cr:replace", "separator": "cr:separator",
    "source": "cr:source", "subField": "cr:subField", "transform": "cr:transform",
}  # fmt: skip
CITATION: Final = (
    "Roos-Hoefgeest, S., Roos-Hoefgeest, M., Álvarez, I., González, R. C. (2023). Simulation of"
    " Laser Profilometer Measurements in the Presence of Speckle Using Perlin Noise. Sensors,"
    " 23(17), 7624. https://doi.org/10.3390/s23177624"
)


def describe(out: Path, dataset: Mapping[str, Any]) -> None:
    """Write README.md and croissant.json of a dataset whose other files exist.

    Parameters
    ----------
    out
        The dataset's folder.
    dataset
        What dataset.json holds.
    """
    write_whole(out / "README.md", _readme(dataset, COLUMNS))
    text = json.dumps(_croissant(out, dataset, COLUMNS), indent=1, ensure_ascii=False)
    write_whole(out / "croissant.json", text + "\n")


def _croissant(
    out: Path, dataset: Mapping[str, Any], columns: Mapping[str, Columns]
) -> dict[str, Any]:
    files = [
        _file(f"{table}.parquet", "application/x-parquet", file_sha256(out / f"{table}.parquet"))
        for table in TABLES
    ]
    files.append(_file("dataset.json", "application/json", file_sha256(out / "dataset.json")))
    files += [
        _file(name, "application/x-hdf5", facts["sha256"])
        for name, facts in dataset["shards"].items()
    ]
    return {
        "@context": CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "name": dataset["name"],
        "description": _what(dataset),
        "version": "1.0.0",
        "citeAs": CITATION,
        "isLiveDataset": False,
        "distribution": files,
        "recordSet": [
            {
                "@type": "cr:RecordSet",
                "@id": table,
                "name": table,
                "description": TABLES[table],
                "field": [
                    {
                        "@type": "cr:Field",
                        "@id": f"{table}/{name}",
                        "name": name,
                        "dataType": TYPES[kind],
                        "source": {
                            "fileObject": {"@id": f"{table}.parquet"},
                            "extract": {"column": name},
                        },
                    }
                    for name, kind in columns[table].items()
                ],
            }
            for table in TABLES
        ],
    }


def _file(name: str, kind: str, sha256: str) -> dict[str, str]:
    return {
        "@type": "cr:FileObject",
        "@id": name,
        "name": name,
        "contentUrl": name,
        "encodingFormat": kind,
        "sha256": sha256,
    }


def _what(dataset: Mapping[str, Any], shown: Callable[[object], str] = str) -> str:
    parts = ", ".join(str(part["part"]) for part in dataset["parts"])
    return (
        f"{dataset['scans']} simulated laser-profilometer scans of {parts} by the sensor"
        f" {shown(dataset['recipe']['sensor']['name'])}, with exact labels of flaws. Generated by"
        f" flawforge {dataset['versions']['flawforge']} from a recipe and the seed"
        f" {dataset['seed']}."
    )


def _readme(dataset: Mapping[str, Any], columns: Mapping[str, Columns]) -> str:
    recipe, statistics = dataset["recipe"], dataset["statistics"]
    counts = statistics["by_class"]
    classes = "\n".join(
        f"| {number} | {name} | {counts.get(name, {}).get('seen', 0)}"
        f" | {counts.get(name, {}).get('visible', 0)} |"
        for number, name in dataset["classes"].items()
        if int(number) > 0
    )
    splits = "\n".join(f"| {name} | {n} |" for name, n in statistics["scans_by_split"].items())
    versions = ", ".join(f"{name} {version}" for name, version in dataset["versions"].items())
    tables = "\n".join(
        f"- `{table}.parquet`, `{table}.csv`: {TABLES[table]}; columns "
        + ", ".join(f"`{name}`" for name in columns[table] if not name.startswith("size_"))
        for table in TABLES
    )
    needed = dataset["reader_needs"]
    plugin = (
        f" Chunks are compressed by {recipe['compression']}: `pip install {needed}` and"
        f" `import {needed}` before the first shard is read."
        if needed
        else ""
    )
    return f"""# {dataset["name"]}

{_what(dataset, as_text)}

Labels follow from the solids that were cut, not from the readings: they are exact to the point.
A scan is {recipe["profiles"]} profiles of {recipe["points"]} points.

| split (by {dataset["split_by"]}) | scans |
| --- | ---: |
{splits}

| class | kind | scans that see it | above the noise |
| ---: | --- | ---: | ---: |
{classes}

## Read

```python
import flawforge

scans = flawforge.open(".").split("{next(iter(statistics["scans_by_split"]), "train")}")
depth, mask = scans[0]["depth"], scans[0]["mask"]    # mm, NaN = missing; class of each point
```

Without flawforge: each `shard-*.h5` holds, scans along the first axis, `depth` (a number n means
`offset_mm + scale_mm * n` of its attributes, `missing` a missing reading), `depth_ideal`,
`depth_clean`, `mask`, `mask_visible`, `instance`, `invalid_reason`, `pose`, `time`.{plugin}
`flawforge view .` makes a gallery; `flawforge export . --to coco` and other forms write files for
other programs.

## Files

{tables}
- `dataset.json`: recipe as used, versions, checksums, statistics, what failed
- `croissant.json`: this description for machines (MLCommons Croissant 1.0)

## Made by

{versions}; `flawforge verify .` checks every file. The dataset belongs to the person who made it.

{as_code(dump_yaml(recipe), "yaml")}

## Cite

{CITATION}
"""
