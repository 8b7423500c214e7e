"""Seals, scores and files of the sealed proof."""

import ast
import hashlib
import json
import shutil
import struct
from dataclasses import asdict, replace
from pathlib import Path

import h5py
import numpy as np
import pytest
import yaml

from challenge.baseline.shuffle import SHUFFLED, shuffle
from challenge.cases.case import SWITCHES, Secret, stage, write
from challenge.cases.nulls import check_null
from challenge.cases.parts import SHAPES
from challenge.cases.seeds import child
from challenge.cases.switches import DECOY, SINGLE, UNKNOWN
from challenge.cases.truth import facts, levelled
from challenge.judging.judge import judge
from challenge.judging.regions import draw_again, drawn_again
from challenge.judging.score import clopper_pearson, judge_case, overlap
from challenge.proof.page import Judged, stopped, write_page
from challenge.proof.scoreboard import figures, table
from challenge.runs.run import run
from challenge.sets.sealed import FULL, commitment, counts_of, draw, seal

ROOT = Path(__file__).resolve().parents[2]
FORMATS = {
    "camera_occlusion", "finite_spot", "edge_mixing", "reflectance_edge", "incidence_noise",
    "incidence_bias", "specular_dropout", "interreflection", "volume_scattering",
    "pixel_locking", "column_offset", "lens_distortion", "line_bow", "range_scale", "pose_error",
    "stage_vibration", "travel_ripple", "motion_blur", "thermal_drift", "outlier_spikes",
    "random_dropout", "anisotropic_lay", "roughness_level", "form_error",
}  # fmt: skip


def test_the_challenge_imports_nothing_of_ours():
    for file in (ROOT / "challenge").rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            names = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                names = [node.module or ""]
            for name in names:
                top = name.split(".")[0]
                assert top not in {"sensors", "diagnosis", "pipeline", "defects", "flawforge"}, file


def test_switches_speak_the_catalogues_names():
    for name, switch in SWITCHES.items():
        assert set(switch.accept) | set(switch.rivals) <= FORMATS, name
        assert set(switch.shapes) <= set(SHAPES), name
    assert set(SINGLE) <= FORMATS
    assert not any(UNKNOWN[name].accept for name in UNKNOWN)
    assert set(DECOY) & set(SINGLE) == set()


def test_a_set_has_all_kinds_and_no_order():
    cases = draw(1, FULL)
    assert len(cases) == 160
    assert [c.kind for c in cases[:20]] != ["null"] * 20
    assert {s for c in cases if c.kind == "one" for s in c.switches} == set(SINGLE)
    assert len({c.seed for c in cases}) == 160
    assert draw(1, FULL) == cases
    assert draw(2, FULL) != cases
    assert len(draw(1, counts_of(24))) == 24
    with pytest.raises(ValueError, match="12 or more"):
        counts_of(11)


def test_commitment_binds():
    secret = Secret(kind="null", switches=(), strength=1, shape="waves", recordings=3, seed=4)
    key, nonce, digest = seal(secret, {"noise_um": 3.0})
    assert commitment(nonce, key) == digest
    assert commitment(nonce, key.replace(b"waves", b"bosse")) != digest
    assert seal(secret, {"noise_um": 3.0})[2] != digest  # another nonce hides equal keys


def test_clopper_pearson_against_known_values():
    # 0 of n: 1 - 0.025**(1/n)
    assert clopper_pearson(0, 60) == (0.0, pytest.approx(1 - 0.025 ** (1 / 60)))
    low, high = clopper_pearson(1, 60)  # Clopper & Pearson (1934): 0.04 % to 8.9 %
    assert low == pytest.approx(0.00042, abs=1e-5)
    assert high == pytest.approx(0.0894, abs=1e-4)


def _answer(verdict, *names, alternatives=()):
    effects = [
        {"name": n, "heldout_gain": 1.0 / (k + 1), "alternatives": list(alternatives)}
        for k, n in enumerate(names)
    ]
    return {"verdict": verdict, "effects": effects}


def _secret(kind, *switches):
    return {"kind": kind, "switches": list(switches), "strength": 1, "recordings": 3}


def test_scores_of_plain_answers():
    region = np.zeros((10, 10), bool)
    region[:5] = True
    args = ({"oracle_gain": 0.5}, _answer("explained", "line_bow", "pose_error"), region, region)
    score = judge_case(_secret("one", "line_bow"), *args, 0.4)
    assert (score.top_1, score.recall, score.precision, score.iou) == (1, 1, 0.5, 1)
    assert score.recovered == pytest.approx(0.8)
    wrong = judge_case(_secret("one", "thermal_drift"), *args, 0.4)
    assert (wrong.top_1, wrong.recall, wrong.precision) == (0, 0, 0)
    beside = _answer("explained", "form_error", alternatives=[{"name": "line_bow"}])
    half = judge_case(_secret("one", "line_bow"), {}, beside, None, None, 0.0)
    assert (half.top_1, half.recall, half.covered) == (0, 0.5, 1)
    both = judge_case(_secret("undecidable", "line_bow"), {}, beside, None, None, 0.0)
    assert both.covered == 1
    null = judge_case(_secret("null"), {}, _answer("match"), None, None, 0.0)
    assert not null.alarm
    scattered = judge_case(_secret("one", "outlier_spikes"), *args, 0.4)
    assert np.isnan(scattered.iou)
    assert np.isnan(scattered.recovered)
    # a coarse camera locks with and without the effect: it leaves no place to compare with
    coarse = judge_case({**_secret("two", "line_bow"), "switches": ["line_bow", "pixel_locking"]},
                        *args, 0.4)  # fmt: skip
    assert np.isnan(coarse.iou)
    assert np.isnan(coarse.recovered)
    unknown = judge_case(_secret("unknown", "lost_counts"), {}, _answer("unexplained"), None,
                         None, 0.0)  # fmt: skip
    assert unknown.flagged
    failed = judge_case(_secret("one", "line_bow"), {}, None, None, region, 0.0)
    assert (failed.top_1, failed.recall, failed.alarm, failed.iou) == (0, 0, False, 0)


@pytest.fixture(scope="module")
def bowed(tmp_path_factory):
    """Make one case with a strong bow, small enough for a test."""
    secret = Secret(
        kind="one", switches=("line_bow",), strength=2, shape="terraces", recordings=2, seed=7
    )
    staged = stage(secret)
    folder = tmp_path_factory.mktemp("case")
    write(secret, staged, folder)
    return secret, staged, folder


def test_strangers_get_what_the_formats_say(bowed):
    secret, staged, folder = bowed
    names = {p.name for p in folder.iterdir()}
    assert names == {"a.h5", "b.h5", "plate-1.h5", "plate-2.h5", "part.stl", "sensor.yaml"}
    sheet = yaml.safe_load((folder / "sensor.yaml").read_text())
    assert [e["name"] for e in sheet["effects"]] == [
        "camera_occlusion", "finite_spot", "edge_mixing", "incidence_noise",
    ]  # fmt: skip
    with h5py.File(folder / "a.h5") as file:
        assert file.attrs["format"] == "profilometer-recording"
        assert file["depth"].dtype == np.float32
        assert file["depth"].shape[1] == sheet["points_per_profile"]
        pose = file["pose"][:]
        turn = pose[:, :3, :3]
        np.testing.assert_allclose(turn @ turn.transpose(0, 2, 1), np.eye(3)[None] + 0 * turn,
                                   atol=1e-12)  # fmt: skip
        assert (np.diff(file["time"][:]) > 0).all()
        depth = file["depth"][:]
        middle, half = sheet["working_distance_mm"], sheet["z_range_mm"] / 2
        assert np.nanmax(np.abs(depth - middle)) <= half
    stl = (folder / "part.stl").read_bytes()
    assert struct.unpack("<I", stl[80:84])[0] == len(staged.on.nominal.faces)
    assert len(stl) == 84 + 50 * len(staged.on.nominal.faces)
    # nothing but the recordings themselves may tell that a bow was hidden
    text = (folder / "sensor.yaml").read_bytes() + stl[:80]
    assert b"bow" not in text


def test_facts_of_a_bow(bowed):
    secret, staged, _ = bowed
    known = facts(staged, secret, draws=2)
    change = known.on_mm - known.off_mm
    column = np.nanmedian(change, 0)
    bend = np.polyfit(np.linspace(-1, 1, column.size), column, 2)[0]
    assert abs(bend) > 0.02
    assert known.oracle_gain > 0.05
    assert 0.2 < known.region.mean() <= 1
    assert known.fair.mean() > 0.8
    assert known.oracle_z > 8
    assert 5 < known.noise_um < 40


@pytest.mark.slow
def test_true_regions_are_drawn_again(bowed, tmp_path):
    secret, staged, _ = bowed
    known = facts(staged, secret)
    keys = tmp_path / "keys"
    keys.mkdir()
    np.savez(keys / "case-001.npz", region=known.region)
    opened = {"secret": asdict(secret), "facts": known.figures()}
    (keys / "case-001.key.json").write_text(json.dumps(opened))
    (keys / "case-002.key.json").write_text(json.dumps(opened))  # without maps: none is judged
    assert drawn_again(tmp_path) == {}
    (tmp_path / "regions").mkdir()
    with pytest.raises(ValueError, match="lacks 1 of 1 cases, case-001"):
        drawn_again(tmp_path)
    assert draw_again(tmp_path, jobs=1) == 0
    found = drawn_again(tmp_path)
    assert list(found) == ["case-001"]
    region, other = found["case-001"]
    assert np.array_equal(region, known.region)
    assert 0.3 < overlap(region, other) < 1.0


def test_flats_tell_no_shift():
    """A bow over two levels keeps its form beside their edge; a shifted slope is taken away."""
    rng = np.random.default_rng(5)
    rows, columns = np.indices((60, 90))
    across = (columns - 45) / 45.0
    # the camera's rays fan out: a tilt along the travel is a little less steep at the line's ends
    levels = np.where(columns < 45, 80.0, 82.0) + 0.002 * rows * (1 - 0.01 * across**2)
    bow = 0.01 * across**2 + 1e-4 * rng.standard_normal(levels.shape)
    soft = levels.copy()
    soft[:, 44:46] += 0.2 * np.array([1.0, -1.0])  # a line of finite width beside the edge
    soft[20:24] += 0.2 * (rows[20:24] - 22)  # and across it
    flat = (np.abs(columns - 45) > 6) & (np.abs(rows - 22) > 6)
    left = levelled(bow, flat, soft)
    plain = np.polynomial.polynomial.polyfit(columns[0], bow.mean(0), 1)
    expected = bow - np.polynomial.polynomial.polyval(columns, plain)
    assert np.abs(left - left[flat].mean() - expected + expected[flat].mean()).max() < 0.005

    hill = 80.0 + np.cos(rows / 9.0) * np.cos(columns / 11.0)
    moved = 0.05 * np.gradient(hill)[0]
    assert np.abs(levelled(moved, np.ones(hill.shape, bool), hill)).max() < 1e-9


def test_a_null_stays_within_its_bound(bowed, monkeypatch):
    monkeypatch.setattr("challenge.cases.nulls.NULL_DRAWS", 40)
    secret, staged, _ = bowed
    # the same staged case with the bow departs; without it it does not
    one = replace(secret, recordings=1)
    departed = check_null(staged, one)
    still = check_null(replace(staged, on=staged.off), one)
    assert still.departure < 0.1 < departed.departure
    assert still.lost < 0.005
    assert still.holds
    assert not departed.holds
    assert still.noise_um > 5
    assert 0.05 < still.edge_share < 0.9
    # forty draws leave 0.8 / sqrt(40) = 0.13 of themselves in the mean departure
    assert 0.1 < still.edge_departure < 1.0


def test_named_streams_are_independent():
    first = child(5, "a").random(4)
    assert (child(5, "a").random(4) == first).all()
    assert (child(5, "b").random(4) != first).all()
    assert (child(6, "a").random(4) != first).all()


@pytest.fixture
def judged(tmp_path, bowed):
    """Seal the bow by hand, with an answer written by hand."""
    secret, staged, folder = bowed
    (tmp_path / "keys").mkdir()
    shutil.copytree(folder, tmp_path / "cases" / "case-001")
    key, nonce, digest = seal(secret, {"noise_um": 15.0, "oracle_gain": 0.4, "concealed": True})
    (tmp_path / "keys" / "case-001.key.json").write_bytes(key)
    kept = {"nonce": nonce, "commitment": digest}
    (tmp_path / "keys" / "case-001.seal.json").write_text(json.dumps(kept))
    (tmp_path / "keys" / "master.json").write_text(json.dumps({"seed": 1}))
    files = {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in folder.iterdir()}
    public = {"protocol": {}, "cases": {"case-001": {"commitment": digest, "files": files}}}
    (tmp_path / "commitments.json").write_text(json.dumps(public))
    answer = tmp_path / "answers" / "case-001"
    answer.mkdir(parents=True)
    (answer / "run.json").write_text(json.dumps({"code": 0, "seconds": 5.0, "said": ""}))
    (answer / "diagnosis.json").write_text(json.dumps(_answer("explained", "line_bow")))
    with h5py.File(folder / "b.h5") as file:
        depth = file["depth"][:]
    with h5py.File(answer / "mismatch.h5", "w") as out:
        for name, shift in (("a", 0.0), ("b", 0.05)):
            group = out.create_group(name)
            group["mask"] = np.ones(depth.shape, bool)
            group["simulated"] = depth + np.float32(shift)
            group["explained"] = depth + np.float32(shift / 5)
    return tmp_path


def test_judge_scores_and_writes_a_page(judged, bowed, tmp_path, monkeypatch):
    monkeypatch.setattr("challenge.proof.page.stage", lambda secret: bowed[1])  # staged already
    scored = judge(judged)
    score = scored["cases"]["case-001"]["score"]
    assert score["top_1"] == 1
    assert score["recovered"] == 1.0  # more than the oracle counts as much
    page = tmp_path / "docs" / "proof.md"
    page.parent.mkdir()
    mine = [Judged.of(scored, judged)]
    write_page(mine, page, commit="abc")
    assert (page.parent / "pictures" / "proof-instrument.png").exists()
    monkeypatch.setattr("challenge.proof.page._show_instrument", lambda scored, file: None)
    write_page(mine, page, commit="abc")
    text = page.read_text()
    assert text.count("- seed 1 ") == 1  # one record for a run, however often it is judged
    assert "Single faults, medium and strong: named rightly, first | 1 of 1" in text
    assert (page.parent / "pictures" / "proof-power.png").exists()
    assert any(f.name == "alarms on nulls" for f in figures(scored))


def test_a_page_shows_no_case_of_a_test_set_and_no_seed(judged, tmp_path):
    scored = {**judge(judged), "population": "test", "family": "second", "seed": 424242}
    page = tmp_path / "proof.md"
    page.write_text("## Record of sealed runs\n\n- seed 9 (160 cases): alarms 0 of 60\n")
    write_page([Judged.of(scored, judged)], page, commit="abc")
    text = page.read_text()
    assert "case-001" not in text
    assert "line_bow |" not in text.split("What was hidden, what was reported")[0]
    assert "424242" not in text
    assert "- seed 9 (160 cases)" in text
    assert "- test set, commit abc (1 cases)" in text
    assert not list(tmp_path.glob("pictures/proof-story*"))


def test_judge_scores_the_shuffled_baseline(judged):
    shutil.copytree(judged / "answers", judged / SHUFFLED)
    answer = judged / SHUFFLED / "case-001" / "diagnosis.json"
    answer.write_text(json.dumps(_answer("explained", "thermal_drift")))
    scored = judge(judged)
    assert scored["cases"]["case-001"]["shuffled"]["top_1"] == 0
    board = "\n".join(table({"first": figures(scored)}))
    assert "| shuffled covariates: top-1, one effect (chance is right) | 0.00 (1) |" in board
    assert "| - the same cases as they are | 1.00 (1) |" in board


def test_shuffled_case_keeps_its_geometry(bowed, tmp_path):
    _, _, folder = bowed
    here = tmp_path / "case"
    shutil.copytree(folder, here)
    shuffle(here, np.random.default_rng(0))
    for name in ("a", "b"):
        with h5py.File(folder / f"{name}.h5") as file, h5py.File(here / f"{name}.h5") as other:
            was, now = file["depth"][:], other["depth"][:]
            np.testing.assert_array_equal(file["pose"][:], other["pose"][:])
            assert was.shape == now.shape
            change = (now - was)[np.isfinite(now) & np.isfinite(was)]
            assert 0.001 < np.median(np.abs(change)) < 0.2  # residuals moved, the part did not


def test_judge_refuses_a_changed_key(judged):
    key = judged / "keys" / "case-001.key.json"
    key.write_bytes(key.read_bytes().replace(b"line_bow", b"form_err"))
    with pytest.raises(ValueError, match="not the one that was committed"):
        judge(judged)


def test_a_run_that_the_clock_stopped_is_judged_only_where_asked(judged):
    public = json.loads((judged / "commitments.json").read_text())
    name = next(iter(public["cases"]))
    (judged / "answers" / name / "run.json").unlink()
    with pytest.raises(ValueError, match="no answer yet"):
        judge(judged)
    scored = judge(judged, partial=True)
    assert scored["sealed"] == len(public["cases"])
    assert len(scored["cases"]) == scored["sealed"] - 1
    assert f"{scored['sealed'] - 1} of {scored['sealed']} sealed cases" in stopped(
        Judged.of(scored, judged)
    )[0]


def test_run_refuses_an_unsealed_set(tmp_path):
    with pytest.raises(ValueError, match="commitments"):
        run(tmp_path, jobs=1, timeout_s=1.0)
