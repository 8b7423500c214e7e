"""`flawforge view`: a gallery of a dataset in one HTML file."""

import argparse
from pathlib import Path

EPILOG = """\
The page opens in a browser without a network. Filters select split, part, kind, size and
detectability. A click on a scan lists its flaws.

example:
  flawforge view out/quickstart      # quickstart.html
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's words."""
    parser.epilog = EPILOG
    parser.add_argument("dataset", metavar="DIR", help="folder of the dataset, or s3://bucket/prefix")
    parser.add_argument(
        "--out", type=Path, metavar="HTML", help="the page (default: DIR.html, here)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Write the page and print its path."""
    from files.errors import RecipeError
    from files.place import place
    from flawforge.progress import shown
    from pipeline.gallery.page import write_gallery

    dataset = place(arguments.dataset)
    out = arguments.out or Path(f"{dataset.resolve().name}.html")
    if out.suffix.lower() not in (".html", ".htm"):
        raise RecipeError(
            "not an HTML file name", where="--out", value=str(out), allowed="NAME.html"
        )
    with shown("flawforge.export"):
        count = write_gallery(dataset, out)
    print(f"{out}: {count} scan{'' if count == 1 else 's'}")
    return 0
