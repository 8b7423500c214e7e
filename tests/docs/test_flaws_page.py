"""The page of the kinds of flaw says what the code says."""

import pytest

from defects.kinds import KINDS
from pipeline.preview.annotation import COLOURS
from tests.support.page_script import DOCS, script

PAGE = script("flaws/make_flaws.py")


def test_page_is_what_the_code_makes():
    page = (DOCS / "flaws.md").read_text(encoding="utf-8")
    assert page == PAGE.text(), "run: python docs/flaws/make_flaws.py --text"


@pytest.mark.parametrize("name", KINDS)
def test_every_kind_has_its_picture_and_a_colour_of_its_own(name):
    picture = DOCS / "flaws" / f"{name}.png"
    assert picture.exists(), f"run: python docs/flaws/make_flaws.py {name}"
    assert picture.stat().st_size > 1000
    assert name in COLOURS, "give it a colour in pipeline/preview/annotation.py"
    assert [COLOURS[other] for other in KINDS].count(COLOURS[name]) == 1
