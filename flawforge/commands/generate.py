"""`flawforge generate`: make a labelled dataset from a recipe."""

import argparse
import time

from flawforge.commands.recipe_options import add_recipe_options
from flawforge.progress import compiling_said, shown
from flawforge.summary import summary

EPILOG = """\
The recipe is a YAML file. docs/recipe.md lists every key, and flawforge init writes a first
recipe. The same recipe and seed give the same bytes for any --jobs. A stopped run continues with
the same command. Exit code: 0 complete, 1 some parts or scans failed (see dataset.json), 2 wrong
recipe.

example:
  flawforge generate quickstart --out out/quickstart --jobs 2
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's words."""
    parser.epilog = EPILOG
    parser.add_argument("recipe", metavar="RECIPE", help="the recipe's YAML file, or 'quickstart'")
    add_recipe_options(parser)
    parser.add_argument(
        "--out", required=True, metavar="DIR",
        help="folder of the dataset, or a prefix of an object store, s3://bucket/prefix",
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
        "--scheduler",
        metavar="ADDRESS",
        help="address of the Dask scheduler, tcp://host:port (with --backend dask)",
    )
    parser.add_argument(
        "--log-json", action="store_true", help="progress on standard output as JSON lines"
    )


def _jobs(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"should be a whole number, 0 or more, got '{text}'")
    return int(text)


def run(arguments: argparse.Namespace) -> int:
    """Make the dataset and print its summary."""
    import os

    from pipeline.batch.backend import Backend

    jobs = arguments.jobs or os.cpu_count() or 1
    with Backend(jobs=jobs, scheduler=arguments.scheduler).started() as backend:
        from files.errors import RecipeError
        from pipeline.batch.run import generate
        from pipeline.dataset.object_store import staged
        from pipeline.recipe import Recipe

        if (arguments.backend == "dask") != (arguments.scheduler is not None):
            raise RecipeError("--scheduler and --backend dask require each other")
        recipe = Recipe.load(
            arguments.recipe,
            roots=tuple(arguments.parts),
            sets=arguments.sets,
            seed=arguments.seed,
        )
        begin = time.monotonic()
        progress = shown("flawforge.generate", json_lines=arguments.log_json)
        with staged(arguments.out) as (store, out), progress, compiling_said():
            if store is not None and arguments.scheduler:
                raise RecipeError(
                    "an object store and --backend dask exclude each other", where="--out",
                    value=arguments.out, allowed="--jobs here, or a folder that all workers share",
                )  # fmt: skip
            dataset = generate(recipe, out, backend=backend, store=store)
    if not arguments.log_json:
        print(summary(dataset, arguments.out, seconds=time.monotonic() - begin))
    return 1 if dataset["failed"] else 0
