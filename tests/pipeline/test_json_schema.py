"""The schema knows every key that the code reads, and refuses what the code refuses."""

import dataclasses
import json
from pathlib import Path

import jsonschema
import pytest

from defects.kinds import KINDS
from files.errors import RecipeError
from files.record import parse
from files.yaml_document import load_yaml
from flawforge.cli import main
from pipeline.injection.flawplan import FlawPlan
from pipeline.json_schema import MEANINGS, schema
from pipeline.recipe import RecipeFile

HOME = Path(__file__).resolve().parents[2]
RECIPES = [
    *HOME.glob("manifests/*.yaml"), *HOME.glob("pipeline/recipes/*.yaml"),
    *HOME.glob("docs/**/*.yaml"),
]  # fmt: skip


@pytest.fixture(scope="module")
def validator() -> jsonschema.Draft202012Validator:
    jsonschema.Draft202012Validator.check_schema(schema())
    return jsonschema.Draft202012Validator(schema())


def recipe() -> dict:
    return load_yaml(HOME / "pipeline" / "recipes" / "quickstart.yaml").data


@pytest.mark.parametrize("path", RECIPES, ids=lambda path: path.name)
def test_every_recipe_is_valid(path: Path, validator: jsonschema.Draft202012Validator) -> None:
    validator.validate(load_yaml(path).data)


def test_every_key_stands_in_it() -> None:
    whole = schema()
    assert {f.name for f in dataclasses.fields(RecipeFile)} == {*whole["properties"]} - {"extends"}
    for entry in whole["$defs"].values():
        assert all("description" in one for one in entry["properties"].values())
    with pytest.raises(ValueError, match="unknown key; allowed: ") as said:
        FlawPlan.from_mapping({"nonsense": 1})
    allowed = str(said.value).partition("allowed: ")[2].split(", ")
    assert sorted(allowed) == sorted(whole["$defs"]["flaws"]["properties"])
    for name, kind in KINDS.items():
        own = whole["$defs"]["flaws"]["properties"][name]["anyOf"][1]["properties"]
        beside = {"number", "tiers", "path"} if name == "bank" else {"number", "tiers"}
        assert {*own} == beside | {size.name for size in kind.sizes()}


def test_no_meaning_is_stale() -> None:
    whole = schema()
    known = {f"RecipeFile.{key}" for key in whole["properties"]}
    known |= {
        f"{name}.{key}" for name, entry in whole["$defs"].items() for key in entry["properties"]
    }
    assert {*MEANINGS} <= known


@pytest.mark.parametrize(
    "change",
    [
        {"sed": 1}, {"profiles": 1}, {"seed": -1}, {"seed": 1.5}, {"parts": "x"},
        {"parts": [{"builtin": "gear"}]}, {"motion": {"yaw_deg": {"uniform": [1]}}},
        {"motion": {"yaw_deg": 400}}, {"flaws": {"dent": {"depth_mm": 90}}},
        {"flaws": {"dimple": 1}}, {"flaws": {"dent": {"tiers": {"a": {"scle": 1}}}}},
        {"splits": {"train": 0}}, {"split_by": "person"},
        {"flaws": {"bank": 1}}, {"flaws": {"bank": {"number": 1}}},
        {"flaws": {"dent": {"path": "a"}}},
    ],
    ids=str,
)  # fmt: skip
def test_schema_and_code_refuse_alike(
    change: dict, validator: jsonschema.Draft202012Validator
) -> None:
    wrong = {**recipe(), **change}
    assert not validator.is_valid(wrong)
    with pytest.raises(RecipeError):
        parse(RecipeFile, wrong)


def test_a_recipe_that_extends_another_may_leave_all_out(
    validator: jsonschema.Draft202012Validator,
) -> None:
    assert validator.is_valid({"extends": "quickstart"})
    assert not validator.is_valid({"seed": 1})


def test_the_command_writes_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema", "--out", str(tmp_path / "s.json")]) == 0
    assert json.loads((tmp_path / "s.json").read_text()) == json.loads(json.dumps(schema()))
    capsys.readouterr()
    assert main(["schema"]) == 0
    assert json.loads(capsys.readouterr().out)["title"] == "flawforge recipe"
