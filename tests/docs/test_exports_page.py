"""Every form of export stands on its page."""

import pytest

from pipeline.dataset.export import FORMS
from tests.support.page_script import DOCS, script

SCRIPT = script("exports/make_exports.py")


@pytest.mark.parametrize("form", FORMS)
def test_a_form_is_opened_on_the_page(form: str) -> None:
    lists = "docs/exports/make_exports.py"
    assert form in SCRIPT.SNIPPETS, f"add a snippet that opens it to SNIPPETS in {lists}"
    assert form in SCRIPT.NOTES, f"add a note to NOTES in {lists}"
    page = (DOCS / "exports.md").read_text(encoding="utf-8")
    assert f"\n## {form}\n" in page, f"run: python {lists} {form}"
    assert f"files: {FORMS[form].summary}." in page, f"run: python {lists} {form}"
