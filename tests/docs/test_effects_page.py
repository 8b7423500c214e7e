"""The page of the catalogue says what the code says."""

import importlib.util
from pathlib import Path

from sensors.effects import CATALOGUE

DOCS = Path(__file__).resolve().parents[2] / "docs"


def script():
    spec = importlib.util.spec_from_file_location("make_effects", DOCS / "effects/make_effects.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_page_is_what_the_code_makes():
    page = (DOCS / "effects.md").read_text(encoding="utf-8")
    assert page == script().text(), "run: python docs/effects/make_effects.py"


def test_every_effect_has_its_picture():
    for name in CATALOGUE:
        assert (DOCS / "effects" / f"{name}.png").stat().st_size > 1000


def test_shown_values_are_within_bounds():
    for name in CATALOGUE:
        assert not script().shown(name).is_null
