"""CONTRIBUTING.md alone is enough: its flaw, sensor, effect and export are added and used."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.page_script import HOME, script

BLOCKS = script("site/blocks.py")
PAGE = HOME / "CONTRIBUTING.md"
FOLDERS = (
    "flawforge", "pipeline", "defects", "sensors", "diagnosis", "quantity", "files", "manifests",
    "benchmarks", "docs", "tests",
)  # fmt: skip
LINES = (
    ("defects/kinds/__init__.py", "\nKINDS:", "from defects.kinds.dimple import Dimple\n"),
    ("defects/kinds/__init__.py", "    )\n}", "Dimple,"),
    ("pipeline/preview/annotation.py", '    "flaw":', '    "dimple": "#123456",\n'),
    ("tests/defects/kinds/test_kinds.py", '}  # fmt: skip\n"""Released', '    "dimple": 16,\n'),
    ("sensors/effects/__init__.py", "\n_EFFECTS",
     "from sensors.effects.heat_haze import HeatHaze\n"),
    ("sensors/effects/__init__.py", "    Empirical,\n)", "    HeatHaze,\n"),
    ("tests/sensors/effects/test_catalogue.py", ']\nMEASURED', '    "heat_haze",\n'),
    ("benchmarks/diagnose.py", ")  # fmt: skip\nOF =",
     '    Case(name="heat_haze", scaled="exponent", part="domes"),\n'),
    ("benchmarks/other_formulas/formulas/__init__.py", ')\n"""Effects', '{"heat_haze"}'),
    ("pipeline/dataset/export/__init__.py", '}\n__all__', '    "xyz": Form(summary="text"),\n'),
    ("docs/exports/make_exports.py", '}\nSNIPPETS', '    "xyz": "Part frame, mm.",\n'),
    ("docs/exports/make_exports.py", '}\nELSEWHERE',
     '    "xyz": "import pathlib; print(len(list(pathlib.Path().glob(\'*/*.xyz\'))))\\n",\n'),
)  # fmt: skip
"""The lines that the page asks for: file, what they stand before, the line."""


def checkout(folder: Path) -> Path:
    """Copy the checkout, with the interpreter of this run as its environment."""
    out = shutil.ignore_patterns(".pytest_cache", ".hypothesis", ".mypy_cache", ".ruff_cache")
    for name in FOLDERS:
        shutil.copytree(HOME / name, folder / name, ignore=out)
    shutil.copyfile(HOME / "pyproject.toml", folder / "pyproject.toml")
    bin_folder = folder / ".venv" / "bin"
    bin_folder.mkdir(parents=True)
    for name, words in (("python", ""), ("flawforge", " -m flawforge.cli")):
        command = bin_folder / name
        command.write_text(f'#!/bin/sh\nexec "{sys.executable}"{words} "$@"\n')
        command.chmod(0o755)
    return folder


def insert(path: Path, before: str, line: str) -> None:
    """Put a line of a list where the page asks for it."""
    text = path.read_text(encoding="utf-8")
    assert text.count(before) == 1, (path, before)
    path.write_text(text.replace(before, line + before), encoding="utf-8")


@pytest.mark.slow
def test_the_page_s_additions_work(tmp_path: Path) -> None:
    home = checkout(tmp_path)
    for block in BLOCKS.blocks(PAGE):
        if block.file:
            block.written(home)
    for file, before, line in LINES:
        insert(home / file, before, line)
    BLOCKS.run(PAGE, home, home)
    files = [b.file for b in BLOCKS.blocks(PAGE) if b.file.endswith(".py")]
    subprocess.run([sys.executable, "-m", "ruff", "check", *files], cwd=home, check=True)


def test_nothing_in_the_diagnosis_is_edited() -> None:
    files = [file for file, _, _ in LINES] + [block.file for block in BLOCKS.blocks(PAGE)]
    assert not [file for file in files if file.startswith("diagnosis/")]
