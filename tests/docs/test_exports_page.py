"""Every form of export stands on its page."""

import pytest

from pipeline.dataset.export import FORMS
from tests.support.page_script import DOCS, script

SCRIPT = script("exports/make_exports.py")


@pytest.mark.parametrize("form", FORMS)
def test_a_form_is_opened_on_the_page(form: str) -> None:
    assert form in SCRIPT.SNIPPETS
    assert form in SCRIPT.NOTES
    page = (DOCS / "exports.md").read_text(encoding="utf-8")
    assert f"\n## {form}\n" in page, "run make exports"
    assert f"files: {FORMS[form].summary}." in page
