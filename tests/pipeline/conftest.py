"""A dataset small enough to be made in a second or two."""

import shutil
from pathlib import Path

import pytest

from tests.support.tiny_recipe import write_recipe


@pytest.fixture
def recipe_path(tmp_path: Path) -> Path:
    """A recipe in a folder of its own, with its sensor beside it."""
    return write_recipe(tmp_path / "recipe")


@pytest.fixture(scope="session")
def made_once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The tiny dataset, made without interruption by one process; not to be written to."""
    from pipeline.batch.run import generate
    from pipeline.recipe import Recipe

    folder = tmp_path_factory.mktemp("tiny")
    generate(Recipe.load(write_recipe(folder / "recipe")), folder / "dataset")
    return folder / "dataset"


@pytest.fixture
def once(made_once: Path, tmp_path: Path) -> Path:
    """A copy of the tiny dataset."""
    shutil.copytree(made_once, tmp_path / "once")
    return tmp_path / "once"
