"""Options of commands that read a recipe: overridden values and further folders."""

import argparse
from pathlib import Path


def add_recipe_options(parser: argparse.ArgumentParser) -> None:
    """Declare --set, --seed and --parts."""
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", dest="sets",
        help="override a key of the recipe, as in motion.yaw_deg=5",
    )  # fmt: skip
    parser.add_argument("--seed", type=int, metavar="N", help="override the recipe's seed")
    parser.add_argument(
        "--parts",
        type=Path,
        action="append",
        default=[],
        metavar="DIR",
        help="further folder for the recipe's parts and sensors",
    )
