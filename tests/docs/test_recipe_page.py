"""docs/recipe.md is what the code makes now, with every key in it."""

import re

from pipeline.json_schema import schema
from tests.support.page_script import DOCS, script


def test_the_page_is_up_to_date_and_misses_no_key() -> None:
    page = (DOCS / "recipe.md").read_text(encoding="utf-8")
    assert page == script("recipe/make_recipe.py").page(), "run make recipe"
    whole = schema()
    keys = {*whole["properties"]}
    for entry in whole["$defs"].values():
        keys |= {*entry["properties"]}
    for kind in whole["$defs"]["flaws"]["properties"].values():
        for one in kind.get("anyOf", ()):
            keys |= {*one.get("properties", {})}
    assert keys <= {*re.findall(r"`(\w+)`", page)}
