"""Numbers stand in one place, with their meaning; the evidence knows no effect by name."""

import ast
import json
import re
from pathlib import Path

import pytest

import diagnosis
from diagnosis.settings import SETTINGS, Settings
from quantity import quantities
from sensors.effects import CATALOGUE

ROOT = Path(diagnosis.__file__).parent
ROOMS = ("components", "discrepancy", "evidence")
FILES = sorted(file for room in ROOMS for file in (ROOT / room).glob("*.py"))
FORM = {"COMB", "REACH", "LEFT", "NEAR", "ROUNDING", "IMITATED", "STEPS", "SETTLED", "SPREADS",
        "AT_ONCE", "ROUNDED", "SPARSE", "TRAVEL", "BLOCK", "SURROUNDINGS",
        "BINS", "LEAST_CYCLES", "FEWEST"}  # fmt: skip
"""Constants of arithmetic: how a sum is formed, when an iteration ends."""


@pytest.mark.parametrize("file", FILES, ids=lambda p: p.name)
def test_no_number_of_the_evidence_stands_outside_the_settings(file: Path) -> None:
    for node in ast.parse(file.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and any(
            isinstance(c, ast.Constant) and isinstance(c.value, int | float)
            for c in ast.walk(node.value)
        ):
            names = {t.id for t in node.targets if isinstance(t, ast.Name)}
            assert names <= FORM, f"{file.name}: {names} belongs to settings.py"


@pytest.mark.parametrize("file", FILES, ids=lambda p: p.name)
def test_the_evidence_knows_no_effect_by_name(file: Path) -> None:
    text = file.read_text(encoding="utf-8")
    for name, kind in CATALOGUE.items():
        assert not re.search(rf"['\"]{name}['\"]|\b{kind.__name__}\b", text), name


def test_every_setting_says_what_it_is_and_where_it_comes_from() -> None:
    for q in quantities(Settings):
        assert q.meaning, q.name
        assert q.source, q.name


def test_settings_are_written_whole() -> None:
    written = json.loads(json.dumps(SETTINGS.as_json()))
    assert set(written) == set(Settings.__dataclass_fields__)
