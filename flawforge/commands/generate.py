"""`flawforge generate`: make a labelled dataset from a recipe."""

import argparse
import time
from pathlib import Path

from flawforge.commands.recipe_options import add_recipe_options
from flawforge.progress import compiling_said, shown
from flawforge.summary import summary

EPILOG = """\
The recipe is a YAML file: docs/recipe.md has every key, flawforge init writes one. The same recipe
and seed give the same bytes for any --jobs. Started again after it was stopped, the command goes on
where it was. Exit code: 0 all made, 1 some parts or scans failed (see dataset.json), 2 bad recipe.

example:
  flawforge generate quickstart --out out/quickstart --jobs 2
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's words."""
    parser.epilog = EPILOG
    parser.add_argument(
        "recipe", metavar="RECIPE", help="the recipe's YAML file, or 'quickstart'"
    )
    add_recipe_options(parser)
    parser.add_argument(
        "--out", type=Path, required=True, metavar="DIR", help="folder of the dataset"
    )
    parser.add_argument(
        "--jobs", type=_jobs, default=1, metavar="N", help="processes (default 1; 0 = all cores)"
    )
    parser.add_argument(
        "--backend",
        choices=("processes", "dask"),
        default="processes",
        help="where shards are made (default: processes on this machine)",
    )
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="with --backend dask: its scheduler, tcp://host:port"
    )
    parser.add_argument(
        "--log-json", action="store_true", help="progress on standard output, JSON line by line"
    )


def _jobs(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"should be a whole number, 0 or more, got '{text}'")
    return int(text)


def run(arguments: argparse.Namespace) -> int:
    """Make the dataset; say on standard output what came out."""
    import os

    from pipeline.batch.backend import Backend

    jobs = arguments.jobs or os.cpu_count() or 1
    with Backend(jobs=jobs, scheduler=arguments.scheduler).started() as backend:
        from pipeline.batch.run import generate
        from pipeline.recipe import Recipe
        from sensors.typed_yaml import RecipeError

        if (arguments.backend == "dask") != (arguments.scheduler is not None):
            raise RecipeError("--scheduler and --backend dask go together")
        recipe = Recipe.load(
            arguments.recipe,
            roots=tuple(arguments.parts),
            sets=arguments.sets,
            seed=arguments.seed,
        )
        begin = time.monotonic()
        progress = shown("flawforge.generate", json_lines=arguments.log_json)
        with progress, compiling_said():
            dataset = generate(recipe, arguments.out, backend=backend)
    if not arguments.log_json:
        print(summary(dataset, arguments.out, seconds=time.monotonic() - begin))
    return 1 if dataset["failed"] else 0
