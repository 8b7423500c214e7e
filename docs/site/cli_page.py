"""The page of the command line: `--help` of every command, as the parsers write it."""

import argparse
import os
from collections.abc import Iterator
from unittest import mock

from flawforge.cli import COMMANDS, parsers

WIDTH = 100
HEAD = """\
# Command line

Made by the site's build from `--help`.

Exit codes: 0, done; 1, done in part or a check failed; 2, wrong input or a fault of the system;
130 and 143, stopped by Ctrl-C and SIGTERM. An error is one line on standard error.
`flawforge --debug COMMAND` shows the traceback.
"""


def text() -> str:
    """Return the page."""
    with mock.patch.dict(os.environ, {"COLUMNS": str(WIDTH)}):
        sections = [section("flawforge", parsers(None)[0])]
        for name in COMMANDS:
            for title, parser in tree(f"flawforge {name}", parsers(name)[1]):
                sections.append(section(title, parser))
    return HEAD + "".join(sections)


def section(title: str, parser: argparse.ArgumentParser) -> str:
    """Return a command's heading and its help."""
    return f"\n## {title}\n\n```text\n{parser.format_help().rstrip()}\n```\n"


def tree(
    title: str, parser: argparse.ArgumentParser
) -> Iterator[tuple[str, argparse.ArgumentParser]]:
    """Yield a command and the commands below it."""
    yield title, parser
    for action in parser._subparsers._group_actions if parser._subparsers else ():
        for name, below in dict(action.choices or {}).items():
            yield from tree(f"{title} {name}", below)
