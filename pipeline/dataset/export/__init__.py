"""Datasets in the forms that other programs open, one file for each form.

Each module of `forms/` holds `write(source, out)`, which writes the chosen scans into the folder
`out` and yields every file as it is finished; the same dataset and options give the same bytes.
"""

import importlib
import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from files.errors import RecipeError
from files.place import place
from pipeline.dataset.export.source import ImageChoice, MaskChoice, Source

LOG = logging.getLogger("flawforge.export")


@dataclass(frozen=True, kw_only=True, slots=True)
class Form:
    """A form of export.

    Attributes
    ----------
    summary : str
        What is written, in a line.
    labels : bool
        Whether `mask` and `min_pixels` apply.
    image : str or None
        What its pictures hold unless said otherwise; None: it has no pictures to choose.
    package : str or None
        The optional package that it needs; its name is the extra's, too.
    """

    summary: str
    labels: bool = True
    image: ImageChoice | None = None
    package: str | None = None


FORMS: Final[Mapping[str, Form]] = {
    "recording": Form(summary="recording.h5 and sensor.yaml, for flawforge diagnose", labels=False),
    "ply": Form(summary="labelled point clouds, part frame, mm"),
    "las": Form(summary="LAS 1.4 point clouds, metres, class and instance", package="laspy"),
    "png": Form(summary="pictures, masks, instances by split", image="depth16"),
    "tiff": Form(summary="float32 depth in mm with its pitch, and masks", package="tifffile"),
    "coco": Form(
        summary="instance segmentation: annotations/instances_SPLIT.json",
        image="relief8",
        package="pycocotools",
    ),
    "yolo": Form(summary="instance segmentation: data.yaml, images, labels", image="relief8"),
    "mvtec3d": Form(summary="anomaly detection: folders as MVTec 3D-AD's", package="tifffile"),
    "hf": Form(summary="a folder for the Hugging Face hub, parquet", image="relief8"),
    "webdataset": Form(
        summary="tar files by split, a picture, masks and facts for each scan", image="relief8"
    ),
}
__all__ = ["FORMS", "Form", "export"]


def export(
    dataset: str | Path,
    out: str | Path,
    to: str,
    scans: Sequence[str] | None = None,
    *,
    splits: Sequence[str] | None = None,
    mask: MaskChoice | None = None,
    min_pixels: int | None = None,
    image: ImageChoice | None = None,
) -> list[Path]:
    """Write scans of a dataset in another form.

    Progress goes to the logger "flawforge.export": an event "plan" with the number of scans, and
    one "scan" for each that is done.

    Parameters
    ----------
    dataset : path
        The dataset's folder, or its prefix of an object store.
    out : path
        Folder to write into; made where it doesn't exist.
    to : str
        A key of `FORMS`.
    scans, splits : sequence of str, optional
        Which scans, by their ids and splits; all by default.
    mask : {"all", "visible"}
        Label all points of a flaw (default), or those where it exceeds the noise.
    min_pixels : int
        Leave out flaws with fewer labelled points in a scan (default 1).
    image : {"relief8", "depth16", "float32"}
        What pictures hold: local relief in 8 bits, depth in 16, or depth in mm; the default is the
        form's.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    RecipeError
        Where there is no dataset, no such scan or split, a shard can't be read, an option doesn't
        apply, or an optional package isn't installed.
    """
    if to not in FORMS:
        raise RecipeError("no such form to export to", value=to, allowed=", ".join(FORMS))
    form = FORMS[to]
    given = {"--mask": mask, "--min-pixels": min_pixels, "--image": image}
    unfit = () if form.labels else ("--mask", "--min-pixels")
    for option in (*unfit, *(() if form.image else ("--image",))):
        if given[option] is not None:
            raise RecipeError(f"doesn't apply to --to {to}", where=option, value=given[option])
    if min_pixels is not None and min_pixels < 1:
        raise RecipeError("too few", where="--min-pixels", value=min_pixels, allowed="at least 1")
    source = Source.read(
        place(dataset), scans=scans, splits=splits, mask=mask or "all", min_pixels=min_pixels or 1,
        image=image or form.image or "float32",
    )  # fmt: skip
    try:
        writer = importlib.import_module(f"pipeline.dataset.export.forms.{to}")
    except ImportError as error:
        if form.package is None or error.name != form.package:
            raise
        raise RecipeError(
            f"needs the package {form.package}, which isn't installed here",
            where=f"--to {to}",
            allowed=f"pip install 'flawforge[{to}]', or --to " + ", ".join(
                name for name, other in FORMS.items() if other.package is None
            ),
        ) from None
    Path(out).mkdir(parents=True, exist_ok=True)
    LOG.info("plan", extra={"event": "plan", "facts": {"scans": len(source.manifest)}})
    return list(writer.write(source, Path(out)))
