"""`flawforge export`: turn a dataset into the form that another program opens."""

import argparse
from pathlib import Path

EXAMPLES = """\
Pictures (--image): relief8 is the local relief in 8 bits, depth16 the depth in 16 bits, float32
the depth in mm. All pictures share one scale, stated in a file beside them. See docs/exports.md.

examples:
  flawforge export out/quickstart --to coco --mask visible --min-pixels 20
  flawforge export out/quickstart --to recording --out recordings
  flawforge export out/quickstart --to ply --scan car_door-0001-0000
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's words."""
    from pipeline.dataset.export import FORMS

    forms = "\n".join(f"  {name:11} {form.summary}" for name, form in FORMS.items())
    parser.epilog = f"forms:\n{forms}\n\n{EXAMPLES}"
    parser.add_argument("dataset", metavar="DIR", help="folder of the dataset, or s3://bucket/prefix")
    parser.add_argument(
        "--to", choices=tuple(FORMS), required=True, metavar="FORM", help="form to write, see below"
    )
    parser.add_argument(
        "--scan",
        action="append",
        metavar="ID",
        help="scan to export; may be repeated (default: all)",
    )
    parser.add_argument(
        "--splits", metavar="A,B", help="splits to export, separated by commas (default: all)"
    )
    parser.add_argument(
        "--mask",
        choices=("all", "visible"),
        help="label all points of a flaw (default), or those whose deviation exceeds the noise",
    )
    parser.add_argument(
        "--min-pixels", type=int, metavar="N",
        help="omit flaws with fewer labelled points in a scan (default: 1)",
    )  # fmt: skip
    parser.add_argument(
        "--image", choices=("relief8", "depth16", "float32"), help="content of the pictures"
    )
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="folder to write (default: DIR/export-FORM)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Export and print the number of files."""
    from files.errors import RecipeError
    from files.place import is_url
    from flawforge.progress import shown
    from pipeline.dataset.export import export

    if arguments.out is None and is_url(arguments.dataset):
        raise RecipeError("a dataset in an object store requires --out DIR", where="export",
                          value=arguments.dataset)  # fmt: skip
    out = arguments.out or Path(arguments.dataset) / f"export-{arguments.to}"
    with shown("flawforge.export"):
        written = export(
            arguments.dataset,
            out,
            arguments.to,
            arguments.scan,
            splits=arguments.splits.split(",") if arguments.splits else None,
            mask=arguments.mask,
            min_pixels=arguments.min_pixels,
            image=arguments.image,
        )
    print(f"{len(written)} file{'' if len(written) == 1 else 's'} in {out}")
    return 0
