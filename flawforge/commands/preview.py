"""`flawforge preview`: draw a scan of a dataset, or a recipe before anything is generated."""

import argparse
import sys
from pathlib import Path
from typing import Any

from flawforge.commands.recipe_options import add_recipe_options
from flawforge.progress import compiling_said

EPILOG = """\
examples:
  flawforge preview quickstart --out setup.png    part, flaws, sensor fan and path
  flawforge preview out/quickstart --out scan.png                the scan with the most visible flaw
  flawforge preview out/quickstart --scan car_door-0001-0000
  flawforge preview out/quickstart --all --out sheet.png         all scans side by side
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's words."""
    parser.epilog = EPILOG
    parser.add_argument(
        "what",
        metavar="DIR|RECIPE|PART",
        help="folder of a dataset or s3://bucket/prefix, a recipe, or a mesh (as flawforge init"
        " would set it up)",
    )
    parser.add_argument(
        "--scan",
        metavar="ID",
        help="scan of a dataset (default: the one with the most visible flaw)",
    )
    parser.add_argument(
        "--all", action="store_true", help="contact sheet of all scans of a dataset"
    )
    parser.add_argument("--part", metavar="NAME", help="part of a recipe (default: the first)")
    add_recipe_options(parser)
    parser.add_argument(
        "--out", type=Path, default=Path("preview.png"), metavar="PNG", help="default: preview.png"
    )


def run(arguments: argparse.Namespace) -> int:
    """Draw and print the picture's path."""
    from files.errors import RecipeError
    from files.place import is_url, place

    what = place(arguments.what)
    is_dataset = what.is_dir() or is_url(what)
    if arguments.out.suffix.lower() != ".png":
        raise RecipeError(
            "not a PNG file name", where="--out", value=str(arguments.out), allowed="NAME.png"
        )
    if is_dataset:
        _say_if_recipe(what)
    if is_dataset and arguments.part is not None:
        raise RecipeError("--part selects a part of a recipe; --scan selects a scan of a dataset")
    if not is_dataset and arguments.scan is not None:
        raise RecipeError("--scan selects a scan of a dataset; --part selects a part of a recipe")
    if arguments.all and not (is_dataset and arguments.scan is None):
        raise RecipeError("--all requires a dataset and excludes --scan")
    if arguments.all:
        from pipeline.gallery.contact_sheet import contact_sheet

        picture, count = contact_sheet(what, arguments.out)
        print(f"{picture}: {count} scans")
        return 0
    if is_dataset:
        from pipeline.preview.scan_picture import draw_scan

        picture = draw_scan(what, arguments.out, scan_id=arguments.scan)
    else:
        from pipeline.preview.recipe_picture import draw_recipe

        recipe, roots = _recipe(what, tuple(arguments.parts))
        with compiling_said():
            picture = draw_recipe(
                recipe, arguments.out, part=arguments.part, roots=roots, sets=arguments.sets,
                seed=arguments.seed,
            )  # fmt: skip
    print(picture)
    return 0


def _say_if_recipe(what: Path) -> None:
    """Say that the folder's dataset is drawn where a built-in recipe has the same name."""
    from pipeline.recipe_source import built_in_recipes

    if str(what) in built_in_recipes():
        print(f"'{what}' is a folder and a recipe: its dataset is drawn", file=sys.stderr)


def _recipe(what: Path, roots: tuple[Path, ...]) -> tuple[Any, tuple[Path, ...]]:
    """Return the recipe to draw: as named, or of a mesh the one that `flawforge init` writes."""
    from pipeline.parts.mesh.meshfile import SUFFIXES
    from pipeline.recipe_source import recipe_path

    if what.suffix.lower() not in SUFFIXES:
        recipe_path(what, else_a="the folder of a dataset, ")
        return what, roots
    from files.yaml_document import parse_text
    from pipeline.recipe_draft import draft

    place = what.resolve()
    text = draft(what, where=str(place), unit=None, thicken_mm=None)
    return parse_text(text, where=str(what)), (*roots, place.parent)
