"""A drafted recipe loads, names what it guessed, and looks at the part from a sensible side."""

import shlex
from pathlib import Path

import numpy as np
import pytest
import trimesh

from flawforge.cli import main
from pipeline.parts.part import load_part
from pipeline.recipe import Recipe
from pipeline.recipe_draft import choose_sensor, draft, guess_unit, set_up


def box(folder: Path, size: tuple[float, float, float], name: str = "box.stl") -> Path:
    trimesh.creation.box(size).export(folder / name)
    return folder / name


@pytest.mark.parametrize(
    ("longest", "unit"),
    [(120.0, "mm"), (2500.0, "mm"), (4.7, "inch"), (0.12, "m"), (1.2e4, "um"), (1e9, "mm")],
)
def test_the_unit_follows_from_the_size(longest: float, unit: str, tmp_path: Path) -> None:
    assert guess_unit(box(tmp_path, (longest, longest / 2, longest / 5))) == unit


@pytest.mark.parametrize(
    ("size", "look", "travel"),
    [
        ((60, 40, 5), (0, 0, -1), (1, 0, 0)),
        ((40, 60, 5), (0, 0, -1), (0, 1, 0)),
        ((60, 5, 40), (0, -1, 0), (1, 0, 0)),
        ((5, 40, 60), (-1, 0, 0), (0, 0, 1)),
    ],
)
def test_a_plate_is_looked_at_and_travelled_along(
    size: tuple[float, float, float], look: tuple[int, ...], travel: tuple[int, ...], tmp_path: Path
) -> None:
    setup = set_up(load_part(box(tmp_path, size)))
    assert (setup.look, setup.travel) == (look, travel)
    np.testing.assert_allclose(
        [setup.width_mm, setup.length_mm, setup.height_mm], [40, 60, 5], rtol=1e-6
    )


def test_a_side_that_shows_more_is_looked_at(tmp_path: Path) -> None:
    """A trough open to -z shows its floor and its rims there, and hides nothing above."""
    roof = trimesh.creation.cone(30.0, 10.0)  # its mantle, flat enough, faces +z
    roof.apply_transform(trimesh.transformations.rotation_matrix(np.pi, [1, 0, 0]))
    roof.export(tmp_path / "roof.stl")
    setup = set_up(load_part(tmp_path / "roof.stl"))
    assert setup.look == (0, 0, 1), "the mantle now faces down, and is larger than the base"


def test_the_sensor_covers_the_part_if_one_does(tmp_path: Path) -> None:
    name, sheet, covers = choose_sensor(set_up(load_part(box(tmp_path, (60, 30, 5)))))
    assert covers
    assert sheet.x_fov_mm >= 30
    assert name == "KEYENCE-LJ-X8080", "the shortest line that does"
    _, sheet, covers = choose_sensor(set_up(load_part(box(tmp_path, (3000, 2000, 50)))))
    assert not covers
    assert sheet.x_fov_mm > 1000


def test_the_draft_is_a_recipe(tmp_path: Path) -> None:
    path = box(tmp_path, (4.7, 2.4, 0.2), "Halter ü.stl")
    text = draft(path, where=path.name, unit=None, thicken_mm=None)
    (tmp_path / "r.yaml").write_text(text)
    recipe = Recipe.load(tmp_path / "r.yaml")
    assert recipe.file.parts[0].unit == "inch"
    assert "guessed from the size" in text
    assert "given" in draft(path, where=path.name, unit="cm", thicken_mm=None)


def test_the_command_says_what_comes_next_and_that_works(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "cad of mine").mkdir()
    (tmp_path / "work").mkdir()
    part = box(tmp_path / "cad of mine", (60, 40, 8), "my plate.stl")
    monkeypatch.chdir(tmp_path / "work")
    assert main(["init", str(part)]) == 0
    guess, *said = capsys.readouterr().out.splitlines()
    assert guess.startswith("my plate.yaml: unit: mm, guessed from the size; check it: the part")
    assert said[0] == "my plate.yaml: read it, then"
    words = shlex.split(said[1])[1:]
    assert main(words) == 0
    assert (tmp_path / "work" / "my plate-setup.png").stat().st_size > 10_000
    assert main(["init", str(part)]) == 2
    assert "my plate.yaml: file exists; allowed: another name" in capsys.readouterr().err
    small = ["--set", "specimens=1", "--set", "profiles=12", "--set", "points=30"]
    assert main([*shlex.split(said[2])[1:], *small]) == 0
    # the mesh alone is enough for a look
    assert main(["preview", str(part), "--out", "look.png"]) == 0
    assert (tmp_path / "work" / "look.png").stat().st_size > 10_000
