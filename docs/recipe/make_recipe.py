"""Make docs/recipe.md: every key of a recipe from the code.

Run `python docs/recipe/make_recipe.py` from the top of the checkout.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pipeline.json_schema import MODELINE, schema
from pipeline.parts import builtin

HERE = Path(__file__).parent
PAGE = HERE.parent / "recipe.md"
EXAMPLE = HERE / "example.yaml"
SECTIONS = {
    "": "The recipe",
    "PartEntry": "An entry of `parts`",
    "Motion": "`motion`",
    "WaypointPath": "`motion.path`",
    "Waypoint": "An entry of `motion.path.waypoints`",
    "Brightness": "`intensity`",
    "ReflectanceMap": "`reflectance`",
    "Picture": "`reflectance.picture`",
    "Stripes": "An entry of `reflectance.stripes`",
    "Patch": "An entry of `reflectance.patches`",
}
HEAD = f"""# Every key of a recipe

Made by `make recipe` from the code; do not edit. `flawforge init PART.stl` writes a recipe to
start from. `flawforge schema` writes a JSON Schema, with which an editor checks and completes a
recipe. The recipe's first line names the schema: `{MODELINE}`.
`--set KEY=VALUE` overrides a key on the command line.

A **size** is a number or a distribution: `{{uniform: [low, high]}}`,
`{{log_uniform: [low, high]}}`, `{{normal: [mean, sd, low, high]}}` (truncated),
`{{choice: [values]}}`. The range of a size holds for every value of its distribution.

A recipe with `extends` inherits `flaws` and `motion` key by key and every other key as a whole.
"""


def page() -> str:
    """Return the page."""
    whole = schema()
    parts = [HEAD, f"```yaml\n{EXAMPLE.read_text(encoding='utf-8')}```\n"]
    required = whole["anyOf"][0]["required"]
    for name, title in SECTIONS.items():
        record = whole if not name else whole["$defs"][name]
        must = required if not name else record.get("required", [])
        parts += [f"## {title}\n", "\n".join(table(record["properties"], must)), ""]
    for name in builtin.NAMES:
        parts += [f"## `parameters` of `{name}`\n", *parameters(name), ""]
    flaws = whole["$defs"]["flaws"]["properties"]
    kinds = {key: entry for key, entry in flaws.items() if key_of_kind(entry)}
    rest = {key: entry for key, entry in flaws.items() if key not in kinds}
    parts += ["## `flaws`\n", "\n".join(table(rest, [])), ""]
    parts.append(
        "Beside these, a key for each kind: a number of flaws, or a mapping with `number` (a size,"
        " 0 to 1000, default 1), `tiers` (by name: `weight`, `scale`, sizes of its own) and the"
        " kind's sizes. [flaws.md](flaws.md) shows the kinds.\n"
    )
    for kind, entry in kinds.items():
        sizes = {
            key: value
            for key, value in entry["anyOf"][1]["properties"].items()
            if key not in ("number", "tiers")
        }
        parts += [f"### `{kind}`\n", "\n".join(table(sizes, [])), ""]
    return "\n".join(parts).rstrip() + "\n"


def key_of_kind(entry: Mapping[str, Any]) -> bool:
    """Whether an entry of `flaws` is a kind."""
    return any("tiers" in one.get("properties", {}) for one in entry.get("anyOf", ()))


def table(properties: Mapping[str, Any], must: list[str]) -> Iterator[str]:
    """Rows of keys."""
    yield "| key | type | default | range | meaning |"
    yield "| --- | --- | --- | --- | --- |"
    for key, entry in properties.items():
        kind, low_high = described(entry)
        default = f"`{entry['default']}`" if "default" in entry else ""
        default = "required" if key in must else default
        yield f"| `{key}` | {kind} | {default} | {low_high} | {entry['description']} |"


def parameters(name: str) -> Iterator[str]:
    """Rows of a built-in part's sizes."""
    yield "| key | default | range | meaning |"
    yield "| --- | --- | --- | --- |"
    for size in builtin.describe(name):
        yield f"| `{size.name}` | `{size.default:g}` | {size.allowed} | {size.meaning} |"


def described(entry: Mapping[str, Any]) -> tuple[str, str]:
    """Type and range of an entry, in words."""
    if "$ref" in entry:
        return "keys below", ""
    if "enum" in entry:
        return "one of " + ", ".join(f"`{value}`" for value in entry["enum"]), ""
    if "anyOf" in entry:
        some = [one for one in entry["anyOf"] if one.get("type") != "null"]
        if any("uniform" in one.get("properties", {}) for one in some):
            return "size", span(some[0])
        found = [described(one) for one in some]
        return " or ".join(dict.fromkeys(kind for kind, _ in found)), found[0][1]
    if entry["type"] == "array":
        kind, low_high = described(entry["items"]) if "items" in entry else ("anything", "")
        count = f"{entry['minItems']} " if entry.get("minItems") else "list of "
        return f"{count}{'mappings' if kind == 'keys below' else kind + 's'}", low_high
    if entry["type"] == "object":
        kind, low_high = described(entry["additionalProperties"])
        return f"mapping to {kind}", low_high
    names = {"integer": "whole number", "string": "text", "boolean": "true or false"}
    return names.get(entry["type"], entry["type"]), span(entry)


def span(entry: Mapping[str, Any]) -> str:
    """Range of a number, in words."""
    words = {
        "minimum": "at least", "exclusiveMinimum": "above",
        "maximum": "at most", "exclusiveMaximum": "below",
    }  # fmt: skip
    if {"minimum", "maximum"} <= {*entry}:
        return f"{entry['minimum']:g} to {entry['maximum']:g}"
    return " and ".join(f"{word} {entry[key]:g}" for key, word in words.items() if key in entry)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
