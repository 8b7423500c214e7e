"""The page of the catalogue says what the code says."""

from sensors.effects import CATALOGUE
from tests.support.page_script import DOCS, script

PAGE = script("effects/make_effects.py")


def test_page_is_what_the_code_makes():
    page = (DOCS / "effects.md").read_text(encoding="utf-8")
    assert page == PAGE.text(), "run: python docs/effects/make_effects.py"


def test_every_effect_has_its_picture():
    for name in CATALOGUE:
        assert (DOCS / "effects" / f"{name}.png").stat().st_size > 1000


def test_shown_values_are_within_bounds():
    for name in CATALOGUE:
        assert not PAGE.shown(name).is_null
