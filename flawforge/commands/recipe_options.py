"""Options of every command that reads a recipe: values that replace its own, further folders."""

import argparse
from pathlib import Path


def add_recipe_options(parser: argparse.ArgumentParser) -> None:
    """Declare --set, --seed and --parts."""
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", dest="sets",
        help="a value in place of the recipe's, like motion.yaw_deg=5",
    )  # fmt: skip
    parser.add_argument("--seed", type=int, metavar="N", help="a seed in place of the recipe's")
    parser.add_argument(
        "--parts",
        type=Path,
        action="append",
        default=[],
        metavar="DIR",
        help="a further folder that the recipe may read parts and sensors from",
    )
