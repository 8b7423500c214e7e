"""`flawforge init`: write a recipe to start from, for a part."""

import argparse
from pathlib import Path
from shlex import quote

EPILOG = """\
Unit, look direction and sensor are guesses from the part. The recipe's comments mark each guess.

example:
  flawforge init bracket.stl
  flawforge preview bracket.yaml --out bracket-setup.png
  flawforge generate bracket.yaml --out bracket-data
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's words."""
    parser.epilog = EPILOG
    parser.add_argument("part", type=Path, metavar="PART", help="STL, OBJ, PLY or 3MF")
    parser.add_argument(
        "--out", type=Path, metavar="YAML", help="the recipe (default: PART.yaml, here)"
    )
    parser.add_argument(
        "--unit",
        choices=("mm", "cm", "m", "um", "inch"),
        help="unit of the part (default: guessed from the size)",
    )
    parser.add_argument("--thicken-mm", type=float, metavar="MM", help="thickness of an open sheet")


def run(arguments: argparse.Namespace) -> int:
    """Write the recipe and print the next commands."""
    from files.errors import RecipeError
    from files.whole_file import write_whole
    from pipeline.recipe_draft import draft

    part = arguments.part
    out = arguments.out or Path(f"{part.stem}.yaml")
    if out.suffix not in (".yaml", ".yml"):
        raise RecipeError("not a YAML file name", where="--out", value=str(out),
                          allowed="NAME.yaml")  # fmt: skip
    if out.exists():
        raise RecipeError("file exists", where=out, allowed="another name with --out")
    inside = part.resolve().is_relative_to(out.resolve().parent)
    where = part.resolve().relative_to(out.resolve().parent) if inside else part.resolve()
    text = draft(part, where=str(where), unit=arguments.unit, thicken_mm=arguments.thicken_mm)
    write_whole(out, text)
    for line in text.splitlines():
        if "check it" in line:
            key, _, comment = line.partition("#")
            print(f"{out}: {key.strip()}, {comment.strip()}")
    recipe = quote(str(out)) + ("" if inside else f" --parts {quote(str(part.resolve().parent))}")
    print(f"{out}: read it, then")
    print(f"  flawforge preview {recipe} --out {quote(f'{out.stem}-setup.png')}")
    print(f"  flawforge generate {recipe} --out {quote(f'{out.stem}-data')}")
    return 0
