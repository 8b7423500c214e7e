"""`flawforge check`: predict a dataset from a few trial scans."""

import argparse
import time

from flawforge.commands.recipe_options import add_recipe_options

EPILOG = """\
Makes a few scans of each part, discards them, and predicts the dataset: its flaws, duration, size
and shortfalls. Numbers of flaws are exact. The shares of flaws that are seen, visible and
detectable are estimates from the trial. Exit code: 0 no warning, 1 warnings, 2 wrong recipe.

examples:
  flawforge check quickstart
  flawforge check recipe.yaml --scans 10 --jobs 8
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's words."""
    parser.epilog = EPILOG
    parser.add_argument(
        "recipe", metavar="RECIPE", help="a YAML file, or the name of a built-in recipe"
    )
    parser.add_argument(
        "--specimens",
        type=int,
        default=2,
        metavar="N",
        help="specimens tried of each part (default 2)",
    )
    parser.add_argument(
        "--scans", type=int, default=4, metavar="N", help="scans tried of each specimen (default 4)"
    )
    parser.add_argument(
        "--jobs",
        type=int,
        default=1,
        metavar="N",
        help="processes for which the duration is predicted (default 1)",
    )
    add_recipe_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Try the recipe and print the prediction."""
    from files.errors import RecipeError
    from flawforge.summary import MOST_LINES, duration, size, table
    from pipeline.batch.backend import one_thread_each

    for word in ("specimens", "scans", "jobs"):
        if getattr(arguments, word) < 1:
            raise RecipeError(
                "too few", where=f"--{word}", value=getattr(arguments, word), allowed="at least 1"
            )
    one_thread_each()
    from pipeline.batch.trial import try_recipe
    from pipeline.recipe import Recipe

    begin = time.monotonic()
    recipe = Recipe.load(
        arguments.recipe,
        roots=tuple(arguments.parts),
        sets=arguments.sets,
        seed=arguments.seed,
    )
    trial = try_recipe(recipe, specimens=arguments.specimens, scans=arguments.scans)
    dataset = trial.dataset
    splits = dataset["statistics"]["scans_by_split"]
    processes = min(arguments.jobs, len(dataset["shards"]))
    lines = [
        f"tried {trial.scans} scans of {trial.parts_tried} of {trial.parts} parts in"
        f" {duration(time.monotonic() - begin)}; expected of the whole:",
        f"{dataset['scans']} scans in {len(dataset['shards'])} shards,"
        f" {duration(trial.seconds / processes)} with {processes} of"
        f" {arguments.jobs} jobs, {size(trial.bytes_on_disk)}",
        f"splits (by {dataset['split_by']}): "
        + ", ".join(f"{name} {count}" for name, count in splits.items()),
        *table(dataset["statistics"]["by_split"]),
    ]
    for key, said in (("flaws_dropped", "no place for a flaw"), ("failed", "failed")):
        found = dataset[key]
        lines += [f"{said}: {one.get('specimen') or one.get('scan') or one['part']}: {one['why']}"
                  for one in found[:MOST_LINES]]  # fmt: skip
    lines += [f"warning: {text}" for text in dataset["warnings"]]
    print("\n".join(lines))
    return 1 if dataset["warnings"] or dataset["failed"] else 0
