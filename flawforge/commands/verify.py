"""`flawforge verify`: check a dataset's files, also against the lock of a release."""

import argparse
from pathlib import Path

EPILOG = """\
Every file is compared with checksums.sha256 (which sha256sum --check reads, too), and the tables
are compared with the shards. Exit code 1 where a file differs; the output names the file.

A lock identifies a released dataset: recipe, seed, versions, checksums of all shards. With the
same versions a rebuild must give the same bytes. With other versions it must agree within a
tolerance.

examples:
  flawforge verify out/quickstart
  flawforge verify out/release --lock manifests/release.lock --write    write the lock
  flawforge verify out/rebuilt --lock manifests/release.lock            compare a rebuild with it
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's words."""
    parser.epilog = EPILOG
    parser.add_argument("dataset", metavar="DIR", help="folder of the dataset, or s3://bucket/prefix")
    parser.add_argument("--lock", type=Path, metavar="FILE", help="lock of a released dataset")
    parser.add_argument(
        "--content",
        action="store_true",
        help="decode every scan and compare arrays and labels with the tables; a table that was"
        " rewritten in another form is then no fault",
    )
    parser.add_argument("--write", action="store_true", help="write --lock from this dataset")


def run(arguments: argparse.Namespace) -> int:
    """Check, and print one line for each finding."""
    from files.errors import RecipeError
    from files.place import place
    from pipeline.dataset.verify import compare_with_lock, verify, write_lock

    if arguments.write and arguments.lock is None:
        raise RecipeError("--write requires --lock FILE")
    dataset = place(arguments.dataset)
    report = verify(dataset, content=arguments.content)
    print("\n".join(report.lines))
    if report.wrong or arguments.lock is None:
        return 1 if report.wrong else 0
    if arguments.write:
        write_lock(dataset, arguments.lock)
        print(f"wrote {arguments.lock}")
        return 0
    against = compare_with_lock(dataset, arguments.lock)
    print("\n".join(against.lines))
    return 1 if against.wrong else 0
