"""`flawforge verify`: check a dataset's files, also against the lock of a release."""

import argparse
from pathlib import Path

EPILOG = """\
Every file of the dataset is held against checksums.sha256 (sha256sum --check reads it, too), the
tables against the shards. Exit code 1 where something is wrong, each file named.

A lock holds a released dataset: recipe, seed, exact versions, checksums of all shards. With the
same versions a rebuild must give the same bytes; with others it is compared within a tolerance.

examples:
  flawforge verify out/quickstart
  flawforge verify out/release --lock manifests/release.lock --write    make the lock
  flawforge verify out/rebuilt --lock manifests/release.lock            hold a rebuild against it
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's words."""
    parser.epilog = EPILOG
    parser.add_argument("dataset", type=Path, metavar="DIR", help="folder of the dataset")
    parser.add_argument("--lock", type=Path, metavar="FILE", help="lock of a released dataset")
    parser.add_argument(
        "--content",
        action="store_true",
        help="decode every scan and hold arrays and labels against the tables; a table that was"
        " rewritten in another form is no fault then",
    )
    parser.add_argument("--write", action="store_true", help="write --lock from this dataset")


def run(arguments: argparse.Namespace) -> int:
    """Check; one line for each finding."""
    from pipeline.dataset.verify import compare_with_lock, verify, write_lock
    from sensors.typed_yaml import RecipeError

    if arguments.write and arguments.lock is None:
        raise RecipeError("--write needs --lock FILE")
    report = verify(arguments.dataset, content=arguments.content)
    print("\n".join(report.lines))
    if report.wrong or arguments.lock is None:
        return 1 if report.wrong else 0
    if arguments.write:
        write_lock(arguments.dataset, arguments.lock)
        print(f"wrote {arguments.lock}")
        return 0
    against = compare_with_lock(arguments.dataset, arguments.lock)
    print("\n".join(against.lines))
    return 1 if against.wrong else 0
