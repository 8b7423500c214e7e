"""Recipes, sensors and surfaces, right or mutated, are read or answered in one line."""

from pathlib import Path

import pytest
import yaml
from hypothesis import example, given

from files.errors import RecipeError
from pipeline.parts.part_error import PartError
from pipeline.recipe import Recipe
from sensors.model import SensorModel
from sensors.surface.surface import Surface
from tests.fuzz import strategies
from tests.fuzz.effort import effort
from tests.support.small_recipe import RECIPE, SENSOR, SURFACE


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fuzz")
    (folder / "sensor.yaml").write_text(yaml.safe_dump(SENSOR))
    (folder / "surface.yaml").write_text(yaml.safe_dump(SURFACE))
    return folder


def read(load, path: Path, data) -> bool:
    """Write data and load them; whether they were right."""
    text = yaml.dump(data, sort_keys=False, allow_unicode=True)
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    try:
        load(path)
    except (RecipeError, PartError) as error:
        said = str(error)
        assert said.strip(), data
        assert "\n" not in said, data
        return False
    return True


@effort(40)
@given(strategies.mutated(strategies.sensors()))
@example(SENSOR)
def test_sensors(folder, data):
    right = read(SensorModel.load, folder / "s.yaml", data)
    assert right or data is not SENSOR


@effort(80)
@given(strategies.mutated(strategies.surfaces()))
@example(SURFACE)
def test_surfaces(folder, data):
    right = read(Surface.load, folder / "r.yaml", data)
    assert right or data is not SURFACE


@effort(40)
@given(strategies.mutated(strategies.recipes()))
@example(RECIPE)
def test_recipes(folder, data):
    right = read(Recipe.load, folder / "recipe.yaml", data)
    assert right or data is not RECIPE
