"""Recipes by name, from a mapping, extended and overridden; messages name the true place."""

from pathlib import Path

import pytest

from files.errors import RecipeError
from pipeline.recipe import Recipe
from pipeline.recipe_source import read_source

BASE = """\
name: base
seed: 3
sensor: KEYENCE-LJ-X8200
profiles: 20
parts:
  - builtin: steel_plate
flaws:
  dent: {number: 1, depth_mm: 0.5}
  pit: 1
motion: {length_mm: 20, yaw_deg: 3}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "base.yaml").write_text(BASE)
    (tmp_path / "mine.yaml").write_text(
        "extends: base.yaml\nname: mine\nflaws:\n  pit: 2\n  dent: {depth_mm: 0.2}\n"
    )
    return tmp_path


def test_a_recipe_that_flawforge_brings_is_found_by_name() -> None:
    recipe = Recipe.load("quickstart")
    assert recipe.file.name == "quickstart"
    with pytest.raises(RecipeError, match=r"no such recipe, got 'fast'; allowed: .*quickstart"):
        Recipe.load("fast")


def test_a_folder_of_a_built_in_recipes_name_hides_no_recipe(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("quickstart").mkdir()  # as `flawforge generate quickstart --out quickstart` makes it
    assert Recipe.load("quickstart").file.name == "quickstart"
    Path("other").mkdir()
    with pytest.raises(RecipeError, match=r"other: is a folder; allowed: a \.yaml file"):
        Recipe.load("other")


def test_a_mapping_is_a_recipe() -> None:
    data, _ = read_source("quickstart")
    assert Recipe.load(data.data).as_used() == Recipe.load("quickstart").as_used()
    with pytest.raises(RecipeError, match=r"recipe: unknown key 'sed'"):
        Recipe.load({**data.data, "sed": 1})


def test_an_extending_recipe_takes_over_what_it_does_not_say(folder: Path) -> None:
    recipe = Recipe.load(folder / "mine.yaml")
    assert (recipe.file.name, recipe.file.seed) == ("mine", 3)
    used = recipe.as_used()
    # flaws and motion key by key, everything below as a whole
    assert used["flaws"] == {"dent": {"depth_mm": 0.2}, "pit": 2}
    assert used["motion"]["yaw_deg"] == 3


def test_a_wrong_value_is_told_where_it_stands(folder: Path) -> None:
    (folder / "base.yaml").write_text(BASE.replace("profiles: 20", "profiles: 1"))
    with pytest.raises(RecipeError, match=r"base\.yaml:4: .*profiles"):
        Recipe.load(folder / "mine.yaml")
    (folder / "mine.yaml").write_text("extends: base.yaml\nprofiles: 0\n")
    with pytest.raises(RecipeError, match=r"mine\.yaml:2: .*profiles"):
        Recipe.load(folder / "mine.yaml")
    with pytest.raises(RecipeError, match=r"--set profiles: .*profiles"):
        Recipe.load(folder / "mine.yaml", sets=["profiles=-1"])


def test_overrides_reach_every_key(folder: Path) -> None:
    sets = ["flaws.dent.depth_mm={uniform: [0.1, 0.2]}", "parts.0.specimens=4", "surface=car_door"]
    recipe = Recipe.load(folder / "base.yaml", sets=sets, seed=9)
    assert recipe.file.seed == 9
    assert recipe.file.parts[0].specimens == 4
    assert recipe.file.surface == "car_door"
    assert recipe.as_used()["flaws"]["dent"] == {"number": 1, "depth_mm": {"uniform": [0.1, 0.2]}}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("seed", r"--set: isn't an override, got 'seed'; allowed: KEY=VALUE"),
        ("motion..x=1", "isn't an override"),
        ("parts.4.name=x", r"--set parts\.4\.name: no such entry, got 4; allowed: 0 to 0"),
        ("seed.low=1", r"--set seed\.low: has no keys below it, got 3"),
        ("seed=[1", r"--set seed: isn't a value"),
        ("sed=1", r"--set sed: unknown key 'sed'; did you mean 'seed'\?$"),
        ("motion.yaw.deg=5", r"^--set motion\.yaw\.deg: unknown key 'motion\.yaw'; did you mean"),
        ("motion.pitch_deg.uniforn=5", r"^--set motion\.pitch_deg\.uniforn: 'motion\.pitch_deg'"),
        ("flaws.pit=.nan", r"^--set flaws\.pit: "),
        ("colour=red", r"^--set colour: unknown key 'colour'; allowed: compression, detectable_at"),
    ],
)
def test_a_wrong_override_is_one_line(change: str, said: str, folder: Path) -> None:
    with pytest.raises(RecipeError, match=said):
        Recipe.load(folder / "base.yaml", sets=[change])


def test_a_value_to_which_an_override_adds_a_key_is_the_overrides(folder: Path) -> None:
    (folder / "base.yaml").write_text(BASE.replace("yaw_deg: 3", "yaw_deg: {uniform: [1, 2]}"))
    with pytest.raises(RecipeError, match=r"^--set motion\.yaw_deg\.normal: 'motion\.yaw_deg'"):
        Recipe.load(folder / "base.yaml", sets=["motion.yaw_deg.normal=5"])
    (folder / "base.yaml").write_text(BASE.replace("yaw_deg: 3", "yaw_deg: {uniform: 5}"))
    with pytest.raises(RecipeError, match=r"base\.yaml:10: 'motion\.yaw_deg\.uniform'"):
        Recipe.load(folder / "base.yaml", sets=["motion.pitch_deg=5"])


def test_extending_stays_in_the_folder_and_ends(folder: Path) -> None:
    (folder / "sub").mkdir()
    (folder / "sub" / "out.yaml").write_text("extends: ../base.yaml\n")
    with pytest.raises(RecipeError, match=r"out\.yaml:1: the path leads outside"):
        Recipe.load(folder / "sub" / "out.yaml")
    (folder / "loop.yaml").write_text("extends: loop.yaml\n")
    with pytest.raises(RecipeError, match="extend each other"):
        Recipe.load(folder / "loop.yaml")
    (folder / "quick.yaml").write_text("extends: quickstart\nseed: 1\n")
    assert Recipe.load(folder / "quick.yaml").file.seed == 1


def test_good_specimens_have_no_flaws(folder: Path) -> None:
    recipe = Recipe.load(folder / "base.yaml", sets=["good_specimens=2", "specimens=3"])
    entry = recipe.file.parts[0]
    assert recipe.specimens_of(entry) == 5
    assert [bool(recipe.flaws_of(entry, number).kinds) for number in range(5)] == [
        True, True, True, False, False,
    ]  # fmt: skip
