"""surface.yaml: what users write, what is stored, and the paper's model to the letter."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from files.errors import RecipeError
from sensors.datasheet import preset_names
from sensors.surface.surface import Surface

THREE = "name: mine\nrpm_mm: 0.02\nrvm_mm: 0.03\npc_per_mm: 4.0\n"


def written(folder: Path, text: str) -> Path:
    path = folder / "surface.yaml"
    path.write_text(text)
    return path


def test_papers_surfaces_are_there_and_ready() -> None:
    assert {"bearing_cap", "car_door", "steel_plate"} <= set(preset_names("surfaces"))
    door = Surface.load("car_door")
    assert (door.ra_mm, door.pc_per_mm) == (0.0134, 5.9446)
    assert door.pitch_x_mm == pytest.approx(22.5 / 501, rel=1e-6)
    for name in preset_names("surfaces"):
        surface = Surface.load(name)
        assert surface.is_calibrated, name
        assert surface.ready() is surface or surface.ready() == surface


def test_verbatim_field_is_equation_9() -> None:
    door = Surface.load("car_door")
    field = door.field(verbatim=True)
    assert field.amplitude_mm == max(door.rpm_mm, door.rvm_mm)
    assert field.cell_x_mm == field.cell_y_mm == pytest.approx(1.0 / door.pc_per_mm)
    assert (field.octaves, field.persistence, field.aligned) == (4, 0.5, True)
    assert field.heights is None
    reach = door.field(verbatim=True, normalised=True).amplitude_mm / field.amplitude_mm
    assert reach == pytest.approx(math.sqrt(2.0))


def test_surface_survives_being_saved(tmp_path: Path) -> None:
    surface = Surface.load("bearing_cap")
    surface.save(tmp_path / "a.yaml")
    assert Surface.load(tmp_path / "a.yaml") == surface


def test_changed_figures_make_the_stored_noise_stale() -> None:
    surface = Surface.load("steel_plate")
    assert surface.is_calibrated
    assert not replace(surface, rq_mm=0.2).is_calibrated
    assert not replace(surface, pitch_x_mm=0.2).is_calibrated
    assert replace(surface, name="other").is_calibrated


def test_stored_noise_is_what_the_field_draws() -> None:
    surface = Surface.load("steel_plate")
    assert surface.rq_mm is not None
    x, y = np.arange(501) * 0.04, np.arange(100) * 0.4
    z = surface.field().sample(x, y, np.random.default_rng(0))
    assert z.shape == (100, 501)
    assert z.std() == pytest.approx(surface.rq_mm, rel=0.05)
    assert abs(z.mean()) < 0.1 * surface.rq_mm


def test_three_figures_suffice_and_the_scan_gives_the_pitch(tmp_path: Path) -> None:
    surface = Surface.load(written(tmp_path, THREE))
    with pytest.raises(RecipeError, match="pitch_x_mm"):
        surface.ready()
    with pytest.raises(RecipeError, match="every second point"):
        surface.ready(0.2, 0.2)
    assert surface.field(verbatim=True).cell_x_mm == 0.25


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (THREE.replace("0.03", "-0.03"), r"surface.yaml:3.*rvm_mm.*-0.03.*above 0 mm"),
        (THREE + "rz_mm: 1\n", r"surface.yaml:5.*rz_mm"),
        (THREE.replace("rpm_mm: 0.02\n", ""), r"rpm_mm.*missing"),
        ("- 1\n", r"keys and values"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(RecipeError, match=said) as error:
        Surface.load(written(tmp_path, text))
    assert "\n" not in str(error.value)


def test_unknown_surface_names_the_presets() -> None:
    with pytest.raises(RecipeError, match="bearing_cap, car_door"):
        Surface.load("glass")
    with pytest.raises(RecipeError, match=r"'cardoor'; did you mean 'car_door'\?"):
        Surface.load("cardoor")
