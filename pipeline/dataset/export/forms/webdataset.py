"""WebDataset: tar files by split, a picture, masks and facts for each scan."""

import io
import json
import tarfile
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np

from files.whole_file import whole
from pipeline.dataset.export.image import Coding, encoded
from pipeline.dataset.export.source import Labelled, Source, flaw_facts

SCANS_PER_TAR: Final = 256


def write(source: Source, out: Path) -> Iterator[Path]:
    """Write `SPLIT-000000.tar` ...

    Members: `KEY.png` (or .tiff), `KEY.mask.png`, `KEY.instance.png`, `KEY.json`. KEY is the
    scan's id with its dots as %2E, since a key ends at its first dot.
    """
    coding = Coding.of(source)
    for split, count in source.splits.items():
        scans = source.scans(split)
        for number in range(-(-count // SCANS_PER_TAR)):
            path = out / f"{split}-{number:06d}.tar"
            with (
                whole(path) as aside,
                tarfile.open(aside, "w", format=tarfile.USTAR_FORMAT) as tar,
            ):
                for _, scan in zip(range(SCANS_PER_TAR), scans, strict=False):
                    for name, data in _members(scan, coding, source).items():
                        entry = tarfile.TarInfo(name)  # no time, no owner: the same bytes
                        entry.size = len(data)
                        tar.addfile(entry, io.BytesIO(data))
            yield path


def _members(scan: Labelled, coding: Coding, source: Source) -> dict[str, bytes]:
    key = scan.scan_id.replace("%", "%25").replace(".", "%2E")
    facts = {
        "scan_id": scan.scan_id,
        "part": scan.part,
        "specimen": scan.specimen,
        "split": scan.split,
        "image": coding.facts,
        "classes": source.classes,
        "flaws": [
            {"instance": int(f["instance"]), "class": int(f["class_id"]), **flaw_facts(f)}
            for f in scan.flaws
        ],
    }
    return {
        f"{key}{coding.suffix}": coding.file(scan),
        f"{key}.mask.png": encoded(scan.mask),
        f"{key}.instance.png": encoded(scan.instance.astype(np.uint16)),
        f"{key}.json": json.dumps(facts, allow_nan=False).encode(),
    }
