"""Pictures: the reading, the class and the instance of each point."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from files.whole_file import write_whole
from pipeline.dataset.export.image import Coding, encoded
from pipeline.dataset.export.source import Source
from pipeline.dataset.export.texts import write_json


def write(source: Source, out: Path) -> Iterator[Path]:
    """Write `SPLIT/{image,mask,instance}/ID`, `image.json` and `classes.json`.

    Masks are 8-bit grey: the class, 0 = none. Instances are 16-bit grey.
    """
    coding = Coding.of(source)
    yield write_json(out / "image.json", coding.facts)
    yield write_json(out / "classes.json", {"0": "background", **source.classes})
    for scan in source.scans():
        files = {
            f"image/{scan.scan_id}{coding.suffix}": coding.array(scan),
            f"mask/{scan.scan_id}.png": scan.mask,
            f"instance/{scan.scan_id}.png": scan.instance.astype(np.uint16),
        }
        for name, array in files.items():
            path = out / scan.split / name
            path.parent.mkdir(parents=True, exist_ok=True)
            write_whole(path, encoded(array), synced=False)
            yield path
