"""The page of the catalogue says what the code says."""

from PIL import Image

from sensors.effects import CATALOGUE
from tests.support.page_script import DOCS, script

PAGE = script("effects/make_effects.py")


def test_page_is_what_the_code_makes():
    page = (DOCS / "effects.md").read_text(encoding="utf-8")
    assert page == PAGE.text(), "run: python docs/effects/make_effects.py"


def test_every_effect_has_its_picture():
    for name in CATALOGUE:
        with Image.open(DOCS / "effects" / f"{name}.png") as picture:
            stale = picture.text.get(PAGE.STAMP) != PAGE.stamp(name)
            low, high = picture.convert("L").getextrema()
        assert not stale, f"run: python docs/effects/make_effects.py {name}"
        assert low < 64 < 192 < high


def test_another_parameter_is_another_picture(monkeypatch):
    before = {name: PAGE.stamp(name) for name in CATALOGUE}
    assert len({*before.values()}) == len(CATALOGUE)
    monkeypatch.setitem(PAGE.SHOWN, "incidence_noise", {"exponent": 3.0})
    after = {name: PAGE.stamp(name) for name in CATALOGUE}
    assert [name for name in CATALOGUE if before[name] != after[name]] == ["incidence_noise"]


def test_shown_values_are_within_bounds():
    for name in CATALOGUE:
        assert not PAGE.shown(name).is_null
