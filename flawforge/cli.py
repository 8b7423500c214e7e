"""The command line: finds the command, runs it, and turns errors into one line."""

import argparse
import importlib
import keyword
import os
import re
import sys
from collections.abc import Sequence
from contextlib import suppress
from typing import Any, Final, NoReturn, TextIO

from pipeline.batch.stop import heard, stoppable

COMMANDS: Final = {
    "init": "write a first recipe for a part",
    "generate": "make a labelled dataset from a recipe",
    "check": "predict a dataset, its cost and its shortfalls from a few trial scans",
    "preview": "draw a scan of a dataset, or a recipe before anything is generated",
    "schema": "print the JSON Schema of a recipe, for editors",
    "view": "write a gallery of a dataset, one HTML file with filters",
    "verify": "check a dataset's files, and compare them with the lock of a release",
    "export": "write a dataset in the form of another program",
    "import": "convert an instrument's file to recording.h5",
    "plan": "plan passes of the sensor that together cover a part",
    "pod": "estimate the probability of detection as a function of flaw size",
    "roughness": "measure a surface's roughness and write its surface.yaml",
    "flaw": "extract a real flaw from a recording into a bank for recipes",
    "diagnose": "find where and why recordings differ from their simulation",
    "challenge": "test the diagnosis on sealed recordings of an independent instrument",
}
EXAMPLES: Final = """\
examples:
  flawforge check quickstart
  flawforge init bracket.stl
  flawforge generate quickstart --out out/quickstart --jobs 2
  flawforge preview out/quickstart --out scan.png
  flawforge diagnose a.h5 b.h5 c.h5 --part part.stl --sensor sensor.yaml --out diagnosis
  flawforge COMMAND --help      a command's help
"""
STOPPED: Final = {"SIGINT": "interrupted", "SIGTERM": "terminated"}
GO_ON: Final = "finished work is kept; the same command continues from there"
START_AGAIN: Final = "the same command starts from the beginning"
GOES_ON: Final = ("generate", "challenge")
"""Commands that continue an earlier run."""


class Parser(argparse.ArgumentParser):
    """Reports a wrong argument in one line, as every other wrong input."""

    def error(self, message: str) -> NoReturn:
        """Print the error; exit code 2."""
        _say(f"{message}; see {self.prog} --help")
        sys.exit(2)

    def _print_message(self, message: str, file: Any = None) -> None:
        """Print --help; argparse would forget a fault of the output."""
        print(message, end="", file=file)


def command() -> NoReturn:
    """Run the words of the command line and end this process with the exit code."""
    sys.exit(main())


def main(argv: Sequence[str] | None = None) -> int:
    """Run `flawforge` with the given words; return the exit code.

    0: done. 1: done in part, or a check failed. 2: bad input. 130, 143: interrupted, terminated.
    """
    words = sys.argv[1:] if argv is None else argv
    with stoppable():
        try:
            return _guarded(_joined(words))
        except BaseException:
            stop = heard()
            if stop is None:
                raise
            then = GO_ON if _chosen(words) in GOES_ON else START_AGAIN
            _say(f"{STOPPED[stop.name]}; {then}")
            return 128 + stop


def _guarded(words: Sequence[str]) -> int:
    """Run; an error is one line and an exit code, standard output's own faults, too."""
    try:
        code = _main(words)
    except SystemExit as end:  # argparse's, after --help or a wrong word
        if heard() is not None:
            raise
        code = int(end.code or 0)
    except BrokenPipeError:
        code = 1
    except Exception as error:
        if "--debug" in words or heard() is not None:  # a wish to stop may come as any error
            raise
        _say(_said(error))
        code = 2
    fault = _given_out(sys.stdout)
    if fault is not None and code == 0:
        code = 1 if isinstance(fault, BrokenPipeError) else 2
        if code == 2:
            _say(_line(fault))
    return code


def _say(line: str) -> None:
    """Print a line on standard error, if anybody takes it."""
    if sys.stderr is not None:
        with suppress(OSError):
            print(f"flawforge: {line}", file=sys.stderr)
        _given_out(sys.stderr)


def _given_out(stream: TextIO | None) -> OSError | None:
    """Flush a stream; where that fails, let the rest go nowhere, and return the fault."""
    if stream is None:  # closed before Python began
        return None
    try:
        stream.flush()
    except OSError as fault:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
        return fault
    return None


def _chosen(words: Sequence[str]) -> str | None:
    """Return the command among the words."""
    return next((word for word in words if not word.startswith("-")), None)


def _joined(words: Sequence[str]) -> list[str]:
    """Join `--option -1e5` to `--option=-1e5`; argparse takes such numbers for options."""
    joined: list[str] = []
    for word in words:
        before = joined[-1] if joined else ""
        if _is_negative(word) and before.startswith("--") and "=" not in before:
            joined[-1] = f"{before}={word}"
        else:
            joined.append(word)
    return joined


def _is_negative(word: str) -> bool:
    try:
        return word.startswith("-") and [float(number) for number in word.split(",")][0] <= 0.0
    except ValueError:
        return False


def parsers(chosen: str | None) -> tuple[Parser, argparse.ArgumentParser]:
    """Return the parser of the command line, and that of the command chosen (or the first again).

    The arguments of the other commands are not loaded.
    """
    parser = Parser(
        prog="flawforge",
        description="Labelled laser-profilometer scans of flawed CAD parts, and a diagnosis of"
        " the effects that a simulation lacks.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="store_true", help="print the version and stop")
    parser.add_argument("--debug", action="store_true", help="show the traceback of an error")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", title="commands")
    asked: argparse.ArgumentParser = parser
    for name, summary in COMMANDS.items():
        command = commands.add_parser(
            name,
            help=summary,
            description=summary[0].upper() + summary[1:] + ".",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        if name == chosen:  # the others are not even loaded
            command_module(name).add_arguments(command)
            asked = command
    return parser, asked


def _main(words: Sequence[str]) -> int:
    chosen = _chosen(words)
    parser, asked = parsers(chosen)
    if chosen is not None and chosen not in COMMANDS:
        from files.errors import RecipeError, known

        near = known(chosen, [*COMMANDS])
        parser.error(str(RecipeError("no such command", value=chosen, **near)))
    arguments, unknown = parser.parse_known_args(words)
    if unknown:
        asked.error(f"unknown arguments: {' '.join(unknown)}")
    if arguments.version:
        from importlib.metadata import version

        print(f"flawforge {version('flawforge')}")
        return 0
    if arguments.command is None:
        parser.print_help()
        return 0
    code: int = command_module(arguments.command).run(arguments)
    return code


def command_module(name: str) -> Any:
    """Import the module of a command: its `add_arguments` and `run`."""
    return importlib.import_module(f"flawforge.commands.{name}{'_' * keyword.iskeyword(name)}")


def _said(error: Exception) -> str:
    """Return an error in one line, whatever its origin."""
    from flawforge.crash import is_memory, report

    if _is_users(error):
        return _line(error)
    if is_memory(error):
        return "not enough memory; fewer profiles, points or jobs need less"
    return report(error, sys.argv[1:])


def _is_users(error: Exception) -> bool:
    """Whether an error is about what the user gave or the disk (and not a fault of ours)."""
    from files.errors import RecipeError
    from flawforge.dataset import ShardError
    from pipeline.parts.part_error import PartError

    if isinstance(error, OSError) and (error.errno is not None or "errno = " in str(error)):
        return True
    return isinstance(error, RecipeError | PartError | ShardError)


def _line(error: Exception) -> str:
    """Return an error in one line; the file comes first in an error of the system."""
    number = re.search(r"errno = (\d+)", str(error)) if isinstance(error, OSError) else None
    if number is not None:  # of HDF5, whose message holds the system's error number
        return f"the system says: {os.strerror(int(number.group(1)))}"
    if isinstance(error, OSError) and error.strerror:
        said = f"the system says: {error.strerror}"
        return f"{error.filename}: {said}" if error.filename is not None else said
    return " ".join(str(error).split())


if __name__ == "__main__":
    command()
