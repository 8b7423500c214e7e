"""Cases of the second family: drawn, written, sealed, and judged in aggregate."""

import json
import sys

import numpy as np
import pytest
import yaml

from challenge import make as making
from challenge.cases.case import SWITCHES, Secret
from challenge.cases.parts import SHAPES
from challenge.judge import judge
from challenge.run import run
from challenge.score import judge_case
from challenge.sealed import FULL, draw
from challenge.second import case as second
from challenge.second.switches import FAULTS, SINGLE, UNKNOWN
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
        patch.setattr("challenge.make.SMALL", COUNTS)
        made = making.make(folder, seed=3, small=True, jobs=1, family="second")
    assert made == 0
    return folder


def test_faults_have_names_of_their_own_and_accept_names_of_the_catalogue():
    assert not set(FAULTS) & set(SWITCHES)
    assert all(f.accept and set(f.accept) <= set(CATALOGUE) for f in SINGLE.values())
    assert not any(f.accept for f in UNKNOWN.values())


def test_a_full_set_has_every_kind_on_parts_that_show_it():
    cases = draw(5, FULL, "second")
    assert sum(c.kind == "null" for c in cases) == 60
    assert {n for c in cases if c.kind == "one" for n in c.switches} == set(SINGLE)
    for case in cases:
        assert all(case.shape in (FAULTS[n].shapes or SHAPES) for n in case.switches)
    with pytest.raises(ValueError, match="allowed: first, second"):
        draw(5, FULL, "third")


def test_a_null_lies_on_its_part_within_how_parts_are_misplaced(sealed):
    folder = sealed / "cases" / "case-001"
    stated = yaml.safe_load((folder / "sensor.yaml").read_text())
    assert sum(key not in stated for key in second.OPTIONAL) == 2
    sheet = Datasheet.load(folder / "sensor.yaml")
    import trimesh

    mesh = trimesh.load(folder / "part.stl", force="mesh")
    scene = Scene(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    for name in ("a", "b", "c", "base-1", "base-2"):
        got = Recording.load(folder / f"{name}.h5")
        rays = Laser.from_datasheet(sheet, x_mm=got.x_mm)
        rest = got.depth_mm - scene.cast(rays, got.poses).depth_mm
        assert abs(np.nanmedian(rest)) < 0.15
        assert np.isfinite(got.depth_mm).mean() > 0.8


def test_a_set_of_the_second_family_is_a_test_set(sealed, monkeypatch, tmp_path, capsys):
    script = (
        "import json, pathlib\n"
        "pathlib.Path('diagnosis').mkdir()\n"
        "answer = {'verdict': 'match', 'effects': []}\n"
        "pathlib.Path('diagnosis/diagnosis.json').write_text(json.dumps(answer))\n"
    )
    monkeypatch.setattr("challenge.run.accepts_baselines", lambda: True)
    monkeypatch.setattr("challenge.run.command", lambda *_: [sys.executable, "-c", script])
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
            place = world.misplaced[0] @ travel.start @ world.mounting @ np.linalg.inv(travel.start)
            took.append(
                world.device.scan(world.solid, world.facets, travel, np.random.default_rng(1),
                                  specimen=4, misplaced=place)[0]
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
