"""Cases of the second family: drawn, written, sealed, and judged in aggregate."""

import json
import shutil
import sys
from dataclasses import replace

import h5py
import numpy as np
import pytest
import yaml

from challenge.baseline.shuffle import shuffle
from challenge.cases.case import SWITCHES, Secret
from challenge.cases.files import OPTIONAL
from challenge.cases.parts import SHAPES
from challenge.judging.judge import judge
from challenge.judging.score import judge_case
from challenge.runs.run import run
from challenge.second import case as second
from challenge.second.imitation import IMITATES
from challenge.second.meshes import files as mesh_files
from challenge.second.meshes import solid_of_file
from challenge.second.switches import DECOY, FAULTS, SINGLE, UNDECIDABLE, UNKNOWN
from challenge.second.world import placed
from challenge.sets import make as making
from challenge.sets.draw import FULL, draw
from flawforge.cli import main
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet
from sensors.effects import CATALOGUE
from sensors.recording import Recording

COUNTS = {"null": 1, "one": 0, "two": 0, "unknown": 0, "decoy": 0, "undecidable": 0}


@pytest.fixture(scope="module")
def sealed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("second")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("challenge.sets.make.counts_of", lambda _: COUNTS)
        made = making.make(folder, seed=3, cases=12, jobs=1, family="second")
    assert made == 0
    return folder


def test_faults_have_names_of_their_own_and_accept_names_of_the_catalogue():
    assert not set(FAULTS) & set(SWITCHES)
    known = {**SINGLE, **DECOY}
    assert all(f.accept and set(f.accept) <= set(CATALOGUE) for f in known.values())
    assert all(set(f.rivals) <= set(CATALOGUE) - set(f.accept) for f in known.values())
    assert all(set(names) <= set(CATALOGUE) for names in UNDECIDABLE.values())
    assert len(UNKNOWN) >= 8
    assert not any(f.accept for f in UNKNOWN.values())


def test_a_full_set_has_every_kind_on_parts_that_show_it():
    cases = draw(5, FULL, "second")
    assert sum(c.kind == "null" for c in cases) == 60
    drawn = {kind: {n for c in cases if c.kind == kind for n in c.switches} for kind in FULL}
    assert drawn["one"] == set(SINGLE)
    assert drawn["unknown"] == set(UNKNOWN)
    assert drawn["decoy"] == set(DECOY)
    assert drawn["undecidable"] == set(IMITATES) <= set(UNDECIDABLE)
    assert all(c.aligned == (c.kind == "undecidable") for c in cases)
    assert {(c.plates, c.baselines) for c in cases} >= {(0, 0), (0, 2), (2, 0), (2, 2)}
    assert all(c.recordings == (1 if c.kind == "undecidable" else 3) for c in cases)
    for case in cases:
        assert all(case.shape in (FAULTS[n].shapes or SHAPES) for n in case.switches)
    with pytest.raises(ValueError, match="allowed: first, second"):
        draw(5, FULL, "third")


@pytest.mark.slow
def test_a_null_lies_on_its_part_within_how_parts_are_misplaced(sealed):
    folder = sealed / "cases" / "case-001"
    stated = yaml.safe_load((folder / "sensor.yaml").read_text())
    assert sum(key not in stated for key in OPTIONAL) == 2
    sheet = Datasheet.load(folder / "sensor.yaml")
    import trimesh

    mesh = trimesh.load(folder / "part.stl", force="mesh")
    scene = Scene(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    for name in ("a", "b", "c", *(f.stem for f in folder.glob("base-*.h5"))):
        got = Recording.load(folder / f"{name}.h5")
        rays = Laser.from_datasheet(sheet, x_mm=got.x_mm)
        rest = got.depth_mm - scene.cast(rays, got.poses).depth_mm
        assert abs(np.nanmedian(rest)) < 0.15
        assert np.isfinite(got.depth_mm).mean() > 0.8


@pytest.mark.slow
def test_a_set_of_the_second_family_is_a_test_set(sealed, monkeypatch, tmp_path, capsys):
    script = (
        "import json, pathlib\n"
        "pathlib.Path('diagnosis').mkdir()\n"
        "answer = {'verdict': 'match', 'effects': []}\n"
        "pathlib.Path('diagnosis/diagnosis.json').write_text(json.dumps(answer))\n"
    )
    monkeypatch.setattr("challenge.runs.run.accepts_baselines", lambda: True)
    monkeypatch.setattr("challenge.runs.run.command", lambda *_: [sys.executable, "-c", script])
    assert run(sealed, jobs=1, timeout_s=60) == 0
    with pytest.raises(ValueError, match="--aggregate only"):
        judge(sealed)
    record = tmp_path / "record.md"
    capsys.readouterr()
    words = ["challenge", "judge", str(sealed), "--aggregate", "--record", str(record)]
    assert main([*words, "--reason", "a try"]) == 0
    said = capsys.readouterr().out
    assert "alarms on nulls | 0 of 1" in said
    assert "case-001" not in said + record.read_text()
    assert not (sealed / "scores.json").exists()


def test_cad_meshes_lie_flat_in_the_range_and_are_scanned(shared_dir):
    meshes = shared_dir / "meshes" / "cad"
    found = mesh_files(meshes)
    assert len(found) >= 5
    for file in found:
        solid = solid_of_file(file)
        size = np.ptp(solid.vertices_mm, axis=0)
        assert size[0] >= size[1] >= size[2]
        assert max(size[0] / 36.0, size[2] / 7.0) == pytest.approx(1.0, rel=1e-5)
        assert solid.vertices_mm[:, 2].max() == pytest.approx(0.0, abs=1e-5)
        corner = solid.vertices_mm[solid.faces]
        cross = np.cross(corner[:, 1], corner[:, 2])
        assert np.einsum("fi,fi->f", corner[:, 0], cross).sum() > 0  # not turned inside out
    secret = Secret(kind="null", switches=(), strength=1, shape=f"mesh {found[0].name}",
                    recordings=1, seed=5, family="second")  # fmt: skip
    world = second.stage(secret, meshes).on
    depth, _ = world.device.scan(world.solid, world.facets, world.travels[0],
                                 np.random.default_rng(1), specimen=2)  # fmt: skip
    assert np.isfinite(depth).mean() > 0.3


def test_a_folder_without_closed_meshes_is_refused(tmp_path):
    with pytest.raises(ValueError, match="no closed mesh"):
        mesh_files(tmp_path)


def test_names_of_meshes_are_among_the_parts_only_where_some_are_given():
    cases = draw(5, FULL, "second", ["box.stl", "ring.stl"])
    meshed = [c for c in cases if c.shape.startswith("mesh ")]
    assert {c.shape for c in meshed} == {"mesh box.stl", "mesh ring.stl"}
    assert 20 < len(meshed) < 60
    assert not any(FAULTS[n].shapes or FAULTS[n].built for c in meshed for n in c.switches)
    assert not any(c.shape.startswith("mesh ") for c in draw(5, FULL, "second"))


@pytest.mark.slow
def test_every_fault_changes_what_is_delivered_and_keeps_most_of_it():
    for name, fault in FAULTS.items():
        shape = (fault.shapes or ("terraces",))[0]
        secret = Secret(kind="one", switches=(name,), strength=1, shape=shape, recordings=1,
                        seed=11, family="second")  # fmt: skip
        staged = second.stage(secret)
        took = []
        for world in (staged.on, staged.off):
            travel = world.travels[0]
            took.append(
                world.device.scan(world.solid, world.facets, travel, np.random.default_rng(1),
                                  specimen=4, misplaced=placed(world, 0))[0]
            )  # fmt: skip
        on, off = took
        assert np.isfinite(on).mean() > 0.6 * np.isfinite(off).mean(), name
        if on.shape == off.shape:
            assert (np.nan_to_num(on) != np.nan_to_num(off)).mean() > 1e-3, name


def test_the_right_name_scores_and_a_wrong_one_does_not():
    secret = {"kind": "one", "switches": ["worn roller"], "strength": 1, "family": "second"}

    def score(name):
        answer = {"verdict": "explained", "effects": [{"name": name, "heldout_gain": 1.0}]}
        return judge_case(secret, {}, answer, None, None, 0.0)

    assert json.dumps(score("travel_ripple").top_1) == "1.0"
    assert score("line_bow").top_1 == 0.0


def test_only_what_moves_readings_and_should_show_is_made_larger():
    def hidden(switch, strength, z):
        secret = Secret(kind="one", switches=(switch,), strength=strength, shape="waves",
                        recordings=3, seed=1, family="second")  # fmt: skip
        return making.hidden_from_all(secret, z)

    assert hidden("worn roller", 1, 5.0)
    assert not hidden("worn roller", 1, 9.0)
    assert not hidden("worn roller", 0, 5.0)
    assert not hidden("dropping link", 2, 0.0)


@pytest.mark.slow
def test_a_doubled_fault_is_twice_as_large():
    secret = Secret(kind="one", switches=("shaking frame",), strength=1, shape="waves",
                    recordings=1, seed=1, family="second")  # fmt: skip
    sizes = [second.stage(replace(secret, doubled=k)).on.device.robot.shake_mm for k in (0, 1)]
    assert sizes[1] == pytest.approx(2 * sizes[0])


@pytest.mark.slow
def test_a_case_of_the_second_family_is_shuffled_about_its_mesh(sealed, tmp_path):
    here = tmp_path / "case"
    shutil.copytree(sealed / "cases" / "case-001", here)
    shuffle(here, np.random.default_rng(0))
    for name in ("a", "b", "c"):
        was = Recording.load(sealed / "cases" / "case-001" / f"{name}.h5").depth_mm
        now = Recording.load(here / f"{name}.h5").depth_mm
        both = np.isfinite(was) & np.isfinite(now)
        assert both.mean() > 0.7
        assert 1e-4 < np.median(np.abs(now - was)[both]) < 0.3  # residuals moved, the part did not


def test_a_recording_of_nothing_makes_no_case(tmp_path):
    recording = Recording(
        name="a", depth_mm=np.full((4, 30), 100.0), poses=np.tile(np.eye(4), (4, 1, 1)),
        time_s=np.arange(4.0),
    )  # fmt: skip
    recording.save(tmp_path / "a.h5")
    assert second.all_read(tmp_path)
    shutil.copy(tmp_path / "a.h5", tmp_path / "b.h5")
    with h5py.File(tmp_path / "b.h5", "r+") as stored:
        stored["depth"][:] = np.nan
    assert not second.all_read(tmp_path)


def test_what_fails_again_and_again_is_drawn_from_a_part_that_shows_it_too():
    rng = np.random.default_rng(2)
    stepped = next(name for name, fault in FAULTS.items() if fault.shapes)
    secret = Secret(
        kind="one", switches=(stepped,), strength=1, shape="mesh of a file", recordings=3, seed=1,
        family="second", doubled=2,
    )  # fmt: skip
    same = making.redrawn(secret, rng, other_part=False)
    assert (same.shape, same.doubled) == (secret.shape, 0)
    assert same.seed != secret.seed
    assert making.redrawn(secret, rng, other_part=True).shape in FAULTS[stepped].shapes
