"""A gallery of a dataset: one HTML file that needs no network and runs no foreign script."""

import base64
import hashlib
import io
import json
import logging
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from files.whole_file import write_whole
from pipeline.dataset.export.image import Coding
from pipeline.dataset.export.source import Labelled, Source
from pipeline.gallery.thumbnail import thumbnail
from pipeline.preview.annotation import colour_of

if TYPE_CHECKING:
    from PIL.Image import Image

LOG = logging.getLogger("flawforge.export")
LONGEST_PX: Final = 640
QUALITY: Final = 70  # of the relief's WebP
MOST: Final = 5000  # scans in a page, some 10 kB each


def write_gallery(folder: Path, out: Path) -> int:
    """Write the gallery of a dataset; return how many scans it shows.

    Of more scans than `MOST`, evenly chosen ones are shown.
    """
    from jinja2 import Environment

    source = Source.read(folder)
    step = -(-len(source.manifest) // MOST)
    chosen = source.manifest.iloc[::step]
    LOG.info("plan", extra={"event": "plan", "facts": {"scans": len(chosen)}})
    coding = Coding.of(source)
    scans = []
    for row in chosen.to_dict("records"):
        scan = source.scan(row)
        scans.append(_scan(scan, row, coding, source.classes))
        LOG.info("scan", extra={"event": "scan", "facts": {"scans": 1}})
    kinds = sorted({flaw["kind"] for scan in scans for flaw in scan["flaws"]})
    data = {
        "folder": str(folder),
        "scans": scans,
        "colours": {kind: colour_of(kind) for kind in kinds},
    }
    style, script = _text("page.css"), _text("page.js")
    page = Environment(autoescape=True).from_string(_text("page.html.j2"))
    text = page.render(
        name=source.name,
        shown=len(scans),
        total=len(source.manifest),
        style=style,
        script=script,
        style_hash=_hash(style),
        script_hash=_hash(script),
        # a data block can't be left early: no "<" stands in it
        data=json.dumps(data, allow_nan=False).replace("<", "\\u003c"),
    )
    write_whole(out, text)
    return len(scans)


def _scan(
    scan: Labelled, row: Mapping[Any, Any], coding: Coding, classes: dict[int, str]
) -> dict[str, Any]:
    picture = thumbnail(scan, coding, classes, LONGEST_PX)
    return {
        "id": scan.scan_id,
        "split": scan.split,
        "part": scan.part,
        "valid": round(float(row["share_valid"]), 4),
        "width": picture.relief.width,
        "height": picture.relief.height,
        "relief": _address(picture.relief, "WEBP", quality=QUALITY, method=4),
        "labels": _address(picture.labels, "PNG") if scan.mask.any() else "",
        "flaws": [_flaw(flaw, scan) for flaw in scan.flaws],
    }


def _flaw(flaw: Mapping[str, Any], scan: Labelled) -> dict[str, Any]:
    found: dict[str, Any] = {
        "number": int(flaw["instance"]),
        "kind": str(flaw["kind"]),
        "pixels": int((scan.instance == int(flaw["instance"])).sum()),
        "visible": int(flaw["pixels_visible"]),
    }
    for key in ("depth_mm", "snr", "deviation_over_noise"):
        value = flaw.get(key)
        found[key] = None if value is None or value != value else float(f"{value:.4g}")
    known = flaw.get("detectable")
    found["detectable"] = bool(known) if known is not None else found["visible"] > 0
    return found


def _address(image: "Image", kind: str, **options: Any) -> str:
    buffer = io.BytesIO()
    image.save(buffer, format=kind, **options)
    return f"data:image/{kind.lower()};base64,{base64.b64encode(buffer.getvalue()).decode()}"


def _text(name: str) -> str:
    return (resources.files("pipeline") / "gallery" / name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    """Return what a content security policy knows an inline text by."""
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
