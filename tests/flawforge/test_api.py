"""The Python API does what the commands do, and costs nothing until it is called."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

import flawforge
import flawforge.dataset


def test_importing_loads_no_library() -> None:
    code = "import sys, flawforge; print('numpy' in sys.modules, 'pipeline' in sys.modules)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["False", "False"]


def test_names_for_users_come_when_they_are_asked_for() -> None:
    for name in flawforge.__all__:
        assert getattr(flawforge, name) is not None
    assert issubclass(flawforge.RecipeError, ValueError)
    assert flawforge.Datasheet.load("KEYENCE-LJ-X8200").name == "KEYENCE-LJ-X8200"
    assert set(flawforge.__all__) <= set(dir(flawforge))
    with pytest.raises(AttributeError, match="no attribute 'other'"):
        _ = flawforge.other


def test_swapped_arguments_of_an_export_are_named(tmp_path: Path) -> None:
    said = r"export: out and to are swapped, got \('coco', 'made'\); allowed: export\(dataset, out="
    with pytest.raises(flawforge.RecipeError, match=said):
        flawforge.export(tmp_path, "coco", "made")
    with pytest.raises(flawforge.RecipeError, match="no such form to export to, got 'made'"):
        flawforge.export(tmp_path, "out", "made")


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    trimesh.creation.box((20.0, 20.0, 5.0)).export(tmp_path / "part.stl")
    return tmp_path / "part.stl"


@pytest.mark.parametrize("key", ["recordings", "references", "holdout", "baselines"])
def test_one_path_is_a_list_of_one(key: str, mesh: Path, small_dataset: Path) -> None:
    shutil.copytree(small_dataset, mesh.parent / "data")
    flawforge.export(mesh.parent / "data", mesh.parent / "out", "recording")
    given = {"recordings": next(iter((mesh.parent / "out").glob("*.h5"))), key: "none.h5"}
    said: list[str] = []
    with pytest.raises(flawforge.RecipeError, match=r"^none\.h5: .*no such file"):
        flawforge.diagnose(
            **given, part=mesh, sensor="KEYENCE-LJ-X8200", out=mesh.parent / "found" / "a",
            progress=said.append,
        )  # fmt: skip
    assert said == ["reading"]
    assert not (mesh.parent / "found").exists()  # nothing is left of a failed diagnosis


def test_what_is_read_quickly_is_read_first(mesh: Path) -> None:
    with pytest.raises(flawforge.RecipeError, match="KEYENCE-LJ-X820"):
        flawforge.diagnose("none.h5", mesh, "KEYENCE-LJ-X820")
    with pytest.raises(flawforge.RecipeError, match="car_doors"):
        flawforge.diagnose("none.h5", mesh, "KEYENCE-LJ-X8200", surface="car_doors")


def test_a_dataset_from_a_mapping_to_an_export(tmp_path: Path) -> None:
    recipe = {
        "name": "plates", "seed": 1, "sensor": "KEYENCE-LJ-X8200", "surface": "car_door",
        "profiles": 12, "points": 40, "parts": [{"builtin": "steel_plate"}],
        "flaws": {"dent": {"length_mm": 9, "depth_mm": 0.5}}, "motion": {"length_mm": 20},
    }  # fmt: skip
    scans = flawforge.generate(
        recipe, tmp_path / "data", sets={"scans": 3, "motion.yaw_deg": {"uniform": [-5, 5]}}, seed=2
    )
    assert len(scans) == 3
    assert scans.info["seed"] == 2
    assert scans.info["recipe"]["motion"]["yaw_deg"] == {"uniform": [-5, 5]}
    assert flawforge.open(tmp_path / "data", fields=("depth",))[0].keys() == {"depth"}
    written = flawforge.export(scans[1:], tmp_path / "png", "png", mask="visible")
    assert len([path for path in written if path.parent.name == "mask"]) == 2


def test_filters_choose_scans(small_dataset: Path) -> None:
    scans = flawforge.open(small_dataset)
    for kind in ("dent", "pit"):
        for scan in (chosen := scans.filter(kind=kind)):
            labels = {scans.classes[int(c)] for c in np.unique(scan["mask"])}
            assert kind in labels
        assert len(chosen) + len(scans.filter(kind=kind, seen=False)) == len(scans)
    assert len(scans.filter(split="test")) == scans.splits["test"]
    assert len(scans.filter(part="nobody")) == 0
    for scan in scans.filter(visible=True):
        assert scan["mask_visible"].any()
    for scan in scans.filter(visible=False):
        assert not scan["mask_visible"].any()


def test_a_notebook_shows_datasets_and_scans(small_dataset: Path) -> None:
    scans = flawforge.open(small_dataset)
    page = scans._repr_html_()
    assert "<th>scans</th><td>4</td>" in page
    assert "plate" in page
    scans.info["name"] = "<script>"
    assert "<script>" not in scans._repr_html_()
    image = scans.show(1)
    assert image.format == "PNG"
    assert min(image.size) > 500


def test_a_wrong_recipe_is_a_value_error_of_one_line(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="^recipe: key 'name' is missing") as said:
        flawforge.generate({}, tmp_path / "x")
    assert "\n" not in str(said.value)


def test_a_dataset_in_a_folder_of_its_recipes_name_is_generated_twice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    small = {"specimens": 1, "scans": 1, "good_specimens": 0, "profiles": 8, "points": 30}
    first = flawforge.generate("quickstart", "quickstart", sets=small)
    again = flawforge.generate("quickstart", "quickstart", sets=small)
    assert len(first) == len(again) == 3
