"""Recipes: what is wrong is named with its place, and nothing is written."""

import pytest

from files.errors import RecipeError
from pipeline.recipe import Recipe


def changed(path, old, new):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    return path


def test_a_good_recipe_is_read_with_the_files_it_names(recipe_path):
    recipe = Recipe.load(recipe_path)
    assert recipe.datasheet.name == "bench sensor"
    assert recipe.surfaces["car_door"].pc_per_mm == pytest.approx(5.9446)
    assert recipe.points == 80
    assert recipe.file.seed == 0
    assert recipe.as_used()["flaws"]["dent"]["depth_mm"] == 0.5


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("seed: 0", "sead: 0", ["tiny.yaml:2", "unknown key 'sead'", "did you mean 'seed'"]),
        ("seed: 0", "seed: -1", ["tiny.yaml:2", "'seed'", "got -1; allowed: at least 0"]),
        ("profiles: 40", "profiles: 1", ["tiny.yaml:5", "profiles"]),
        ("test: 0.5", "test: 0.6", ["add up to 1"]),
        ("test: 0.5", "test: -0.5", ["'splits.test': got -0.5; allowed: above 0"]),
        ("depth_mm: 0.5", "depth_mm: 500", ["dent.depth_mm", "500", "0.005 to 20"]),
        ("uniform: [6, 9]", "uniform: [9, 6]", ["dent.length_mm", "low <= high"]),
        ("uniform: [6, 9]", "unifrom: [6, 9]", ["dent.length_mm", "uniform"]),
        ("  dent:", "  dnet:", ["tiny.yaml:", "'flaws.dnet': unknown key", "mean 'dent'?"]),
        ("depth_mm: 0.5", "deep_mm: 0.5", ["'flaws.dent.deep_mm': unknown", "mean 'depth_mm'?"]),
        ("builtin: steel_plate\n    name: a", "builtin: steel_plait\n    name: a", ["parts.0"]),
        ("sensor: sensor.yaml", "sensor: nothing", ["no such sensor", "AT-C5-4090CS30-495"]),
        ("sensor: sensor.yaml", "sensor: ../x.yaml", ["outside", "tiny.yaml:3"]),
        ("sensor: sensor.yaml", "sensor: none.yaml", ["none.yaml", "can't be read"]),
        ("surface: car_door", "surface: velvet", ["no such surface", "car_door"]),
        ("yaw_deg: {uniform: [-10, 10]}", "yaw_deg: left", ["motion.yaw_deg", "left"]),
        ("surface: car_door", 'surface: "a\\0.yaml"', ["tiny.yaml:4", "isn't a path"]),
        ("name: tiny", "name: a/b", ["tiny.yaml:1", "'name': 'a/b'"]),
        ("sensor: sensor.yaml", "sensor: nothing", ["tiny.yaml:3: no such sensor", "'nothing'"]),
        ("profiles: 40", "profiles: 1000000\npoints: 1000", ["tiny.yaml:5", "too many points"]),
        ("specimens: 3\nscans: 2", "specimens: 300\nscans: 900000", ["tiny.yaml:7", "at most"]),
        ("length_mm: 25", "length_mm: -25", ["tiny.yaml:21", "0.001 to 1000000 mm"]),
        ("length_mm: 25", "speed_mm_s: {uniform: [0, 5]}", ["'motion.speed_mm_s'"]),
        ("length_mm: 25", "direction: {choice: [-1, 0]}", ["tiny.yaml:21", "'motion.direction'"]),
        ("length_mm: 25", "direction: {uniform: [-1, 1]}", ["'motion.direction'"]),
        ("length_mm: 25", "roll_deg: 90",
         ["motion.roll_deg", "got 90; allowed: -80 to 80 °", "-80 to 80"]),
        ("length_mm: 25", "look: [0, 0, 0]", ["tiny.yaml:20", "must not be zero"]),
        ("length_mm: 25", "look: [0, 1]", ["tiny.yaml:21", "too few entries"]),
        ("length_mm: 25", "profile_rate_hz: 1e9", ["tiny.yaml:20", "beyond the sensor"]),
        ("parts:", "parts: []\nparts2:", ["tiny.yaml"]),
    ],
)
def test_what_is_wrong_is_said_in_one_line(recipe_path, old, new, words):
    before = sorted(recipe_path.parent.rglob("*"))
    with pytest.raises(RecipeError) as caught:
        Recipe.load(changed(recipe_path, old, new))
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message
    assert sorted(recipe_path.parent.rglob("*")) == before


def test_paths_stay_inside_what_the_user_named(recipe_path, tmp_path):
    from pipeline.batch.run import find_wanted

    outside = tmp_path / "elsewhere"
    outside.mkdir()
    (outside / "cube.stl").write_bytes(b"")
    entry = "builtin: steel_plate\n    name: a\n    parameters: {length_mm: 60, width_mm: 50,"
    text = recipe_path.read_text()
    start = text.index("  - builtin")
    stop = text.index("flaws:")
    assert entry in text
    for path in (str(outside / "cube.stl"), "../elsewhere/*.stl"):
        recipe_path.write_text(text[:start] + f"  - path: {path}\n" + text[stop:])
        with pytest.raises(RecipeError, match="outside the recipe's folder"):
            find_wanted(Recipe.load(recipe_path))
    recipe_path.write_text(text[:start] + "  - path: '*.stl'\n" + text[stop:])
    wanted, failed = find_wanted(Recipe.load(recipe_path, roots=(outside,)))
    assert [want.name for want in wanted] == ["cube"]
    assert not failed
