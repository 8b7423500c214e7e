"""docs/recipe.md is what the code makes now, with every key in it."""

import importlib.util
import re
from pathlib import Path

from pipeline.recipe_schema import schema

HOME = Path(__file__).resolve().parents[2]


def test_the_page_is_up_to_date_and_misses_no_key() -> None:
    place = HOME / "docs" / "recipe" / "make_recipe.py"
    spec = importlib.util.spec_from_file_location("make_recipe", place)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    page = (HOME / "docs" / "recipe.md").read_text()
    assert page == module.page(), "run make recipe"
    whole = schema()
    keys = {*whole["properties"]}
    for entry in whole["$defs"].values():
        keys |= {*entry["properties"]}
    for kind in whole["$defs"]["flaws"]["properties"].values():
        for one in kind.get("anyOf", ()):
            keys |= {*one.get("properties", {})}
    assert keys <= {*re.findall(r"`(\w+)`", page)}
