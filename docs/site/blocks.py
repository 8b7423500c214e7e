"""Run the code blocks of a page, one after the other, in one folder.

- `bash` and `python` run; each is a process of its own.
- `yaml` and `python` whose first line is a comment with a file's name are written to that file.
- `text` after a block that ran is its output; `...` stands for anything.
- `text` elsewhere, and `yaml` without a name, stand alone.
"""

import os
import re
import subprocess
import sys
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

HOME = Path(__file__).resolve().parents[2]
FENCE = re.compile(r"^( *)```(\w*)[^\n]*\n(.*?)^\1```$", re.MULTILINE | re.DOTALL)
FILE = re.compile(r"# (\S+\.(?:yaml|py))\b")
LANGUAGES = ("bash", "python", "yaml", "text")


class BlockError(AssertionError):
    """A block failed, or its output differs from the page."""


@dataclass(frozen=True)
class Block:
    """A fenced block: where it starts, its language and its lines."""

    page: str
    line: int
    language: str
    code: str
    follows: bool
    """Whether nothing but white space stands between it and the block before."""

    def __str__(self) -> str:
        return f"{self.page}:{self.line}"

    @property
    def file(self) -> str:
        """Name of the file that the block is; "" where it is none."""
        name = FILE.match(self.code) if self.language in ("python", "yaml") else None
        return name[1] if name else ""

    def written(self, folder: Path) -> None:
        """Write the block's file below `folder`."""
        path = folder / self.file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(self.code, encoding="utf-8")


def blocks(page: Path) -> Iterator[Block]:
    """Yield the blocks of a page."""
    text, end = page.read_text(encoding="utf-8"), 0
    for match in FENCE.finditer(text):
        between, end = text[end : match.start()], match.end()
        yield Block(
            page=page.name,
            line=text.count("\n", 0, match.start()) + 1,
            language=match[2],
            code=textwrap.dedent(match[3]),
            follows=not between.strip(),
        )


def run(page: Path, folder: Path, home: Path = HOME) -> None:
    """Run a page's blocks in `folder`, with the packages of the checkout `home`.

    Raises
    ------
    BlockError
        Where a block has an unknown language, fails, or prints other lines than the page.
    """
    environment, printed = surroundings(folder, home), None
    for block in blocks(page):
        if block.language not in LANGUAGES:
            raise BlockError(f"{block}: language '{block.language}'; allowed: {LANGUAGES}")
        if block.language == "text":
            if block.follows and printed is not None:
                compare(block, printed)
            printed = None
        elif block.file:
            block.written(folder)
            printed = None
        elif block.language == "yaml":
            printed = None
        else:
            printed = output(block, folder, environment)


def surroundings(folder: Path, home: Path) -> dict[str, str]:
    """Return the environment: this Python, and the command of this checkout."""
    commands = folder / ".commands"
    commands.mkdir()
    command = commands / "flawforge"
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m flawforge.cli "$@"\n')
    command.chmod(0o755)
    return {
        **os.environ,
        "PATH": f"{commands}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": str(home),
        "HF_HUB_OFFLINE": "1",
    }


def output(block: Block, folder: Path, environment: dict[str, str]) -> str:
    """Run a block and return what it printed on both streams."""
    words = {"bash": ["bash", "-euo", "pipefail", "-c"], "python": [sys.executable, "-c"]}
    done = subprocess.run(
        [*words[block.language], block.code], cwd=folder, env=environment,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False,
    )  # fmt: skip
    if done.returncode:
        raise BlockError(f"{block}: exit code {done.returncode}\n{block.code}\n{done.stdout}")
    return done.stdout


def compare(block: Block, printed: str) -> None:
    """Hold a block's output to the page, line by line; lines of the program may be left out."""
    lines = iter(printed.splitlines())
    for wanted in block.code.splitlines():
        pattern = re.escape(wanted.rstrip()).replace(re.escape("..."), ".*")
        if not any(re.fullmatch(pattern, line.rstrip()) for line in lines):
            raise BlockError(f"{block}: no line '{wanted}' in\n{printed}")
