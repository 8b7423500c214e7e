"""A batch job's manners: same bytes, after any stop, one run at a time, one bad part no matter."""

import json
import logging
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
import trimesh

from files.errors import RecipeError
from pipeline.batch.run import Backend, generate
from pipeline.dataset.shards import DepthCode, file_sha256, read_scan
from pipeline.parts.part_error import PartError
from pipeline.recipe import Recipe

OUTPUTS = ("shard-*.h5", "manifest.*", "flaws.*", "dataset.json")


def checksums(folder: Path) -> dict[str, str]:
    files = sorted(path for pattern in OUTPUTS for path in folder.glob(pattern))
    return {path.name: file_sha256(path) for path in files}


def test_what_comes_out(once):
    said = json.loads((once / "dataset.json").read_text())
    scans = pd.read_parquet(once / "manifest.parquet")
    flaws = pd.read_parquet(once / "flaws.parquet")
    assert said["scans"] == len(scans) == 12
    assert said["split_by"] == "part"
    assert set(scans["split"]) == {"train", "test"}
    assert scans.groupby("part")["split"].nunique().max() == 1
    assert scans["scan_id"].is_unique
    assert not said["failed"]
    assert (flaws.groupby("scan_id")["instance"].max() <= 3).all()
    for row in scans.itertuples():
        scan = read_scan(once / row.shard, row.row)
        assert scan["scan_id"] == row.scan_id
        assert scan["depth"].shape == (40, 80)
        assert (np.isnan(scan["depth"]) == (scan["invalid_reason"] > 0)).all()
        assert np.isfinite(scan["depth"]).mean() == pytest.approx(row.share_valid)
        mine = flaws[flaws["scan_id"] == row.scan_id].set_index("instance")
        for instance, facts in mine.iterrows():
            assert (scan["instance"] == instance).sum() == facts["pixels"]
            assert (scan["mask"][scan["instance"] == instance] == facts["class_id"]).all()
    again = pd.read_csv(once / "manifest.csv")
    pd.testing.assert_frame_equal(again, scans, check_dtype=False)


def test_each_scan_can_be_read_alone(once):
    with h5py.File(once / "shard-00000.h5") as shard:
        for name, dataset in shard.items():
            assert len(dataset) == 2
            if name != "scan_id":
                assert dataset.chunks[0] == 1
        assert json.loads(shard.attrs["classes"])["1"] == "dent"
        assert shard["depth"].dtype == np.uint16


def test_same_bytes_for_any_number_of_jobs(once, recipe_path, tmp_path):
    generate(Recipe.load(recipe_path), tmp_path / "two", backend=Backend(jobs=2))
    assert checksums(tmp_path / "two") == checksums(once)


def test_same_bytes_whoever_still_holds_a_dataset(once, recipe_path, tmp_path, monkeypatch):
    holding, create = [], h5py.Group.create_dataset

    def create_and_hold(self, *words, **more):
        holding.append(create(self, *words, **more))
        return holding[-1]

    monkeypatch.setattr(h5py.Group, "create_dataset", create_and_hold)
    generate(Recipe.load(recipe_path), tmp_path / "holding")
    assert checksums(tmp_path / "holding") == checksums(once)
    assert holding


@pytest.mark.slow
def test_a_specimen_of_many_shards_is_cut_once(recipe_path, tmp_path, caplog):
    text = recipe_path.read_text().replace("specimens: 3\nscans: 2", "specimens: 1\nscans: 7")
    recipe_path.write_text(text)
    recipe = Recipe.load(recipe_path)
    one = generate(recipe, tmp_path / "one")
    assert len(one["shards"]) == 8
    two, events = tmp_path / "two", []
    (two / ".flawforge" / "parts").mkdir(parents=True)
    for part in "ab":  # of a run that was stopped: not to be read
        (two / ".flawforge" / "parts" / f"{part}-0.flawed").write_bytes(b"not from this run")

    class Watch(logging.Handler):
        def emit(self, record):
            kept = (two / ".flawforge" / "parts").glob("*.flawed")
            events.append(sorted(path.name for path in kept))

    watch, log = Watch(), logging.getLogger("flawforge.generate")
    caplog.set_level(logging.INFO, log.name)
    log.addHandler(watch)
    try:
        generate(recipe, two, backend=Backend(jobs=2))
    finally:
        log.removeHandler(watch)
    assert checksums(two) == checksums(tmp_path / "one")
    assert events[-2] == ["a-0.flawed", "b-0.flawed"]
    assert not (two / ".flawforge" / "parts").exists()


def test_who_comes_second_takes_the_cut_that_is_kept(recipe_path, tmp_path, monkeypatch):
    from pipeline.batch.plan import PlannedPart
    from pipeline.batch.run import find_wanted
    from pipeline.injection import specimen

    recipe = Recipe.load(recipe_path).ready()
    wanted, _ = find_wanted(recipe)
    part = specimen.load_entry(wanted[0].entry, None, "a")
    stored = specimen.store_part(part, tmp_path)
    planned = PlannedPart(name="a", entry=wanted[0].entry, stored=stored)
    made = [
        specimen.make_specimen(recipe, planned, 0, tmp_path, shared=shared).flawed
        for shared in (False, True)
    ]
    monkeypatch.setattr(specimen, "inject", None)
    made.append(specimen.make_specimen(recipe, planned, 0, tmp_path, shared=True).flawed)
    points = made[0].vertices_mm[made[0].faces[made[0].instance > 0]].mean(axis=1)
    for flawed in made:
        assert flawed.vertices_mm.tobytes() == made[0].vertices_mm.tobytes()
        assert flawed.faces.tobytes() == made[0].faces.tobytes()
        assert [one.parameters for one in flawed.flaws] == [
            one.parameters for one in made[0].flaws
        ]
        assert (flawed.removed_at(points) == made[0].removed_at(points)).all()
        assert flawed.part is specimen.stored_part(tmp_path / stored)[0]


def test_another_seed_gives_another_dataset(once, recipe_path, tmp_path):
    recipe_path.write_text(recipe_path.read_text().replace("seed: 0", "seed: 1"))
    generate(Recipe.load(recipe_path), tmp_path / "other")
    mine, other = checksums(once), checksums(tmp_path / "other")
    assert all(mine[name] != other[name] for name in mine)


def started(recipe: Path, out: Path, *more: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "flawforge.cli", "generate", recipe, "--out", out, *more],
        cwd=Path(__file__).resolve().parents[3],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def wait_for_shards(out: Path, count: int, run: subprocess.Popen[str]) -> None:
    deadline = time.monotonic() + 120
    while len(list(out.glob("shard-*.h5"))) < count:
        assert run.poll() is None or run.returncode == 0
        assert time.monotonic() < deadline
        time.sleep(0.005)


@pytest.mark.parametrize("shards", [1, 3])
def test_a_killed_run_goes_on_where_it_was(once, recipe_path, tmp_path, shards, caplog):
    out = tmp_path / "killed"
    run = started(recipe_path, out)
    wait_for_shards(out, shards, run)
    run.send_signal(signal.SIGKILL)
    run.communicate()
    # what a crash may leave: a shard cut short, a half-written one aside
    first = min(out.glob("shard-*.h5"))
    kept = os.stat(first).st_mtime_ns
    (out / ".shard-00001.h5.dead.part").write_bytes(b"x")
    caplog.set_level(logging.INFO, "flawforge.generate")
    generate(Recipe.load(recipe_path), out)
    assert checksums(out) == checksums(once)
    assert not list(out.glob(".*.part"))
    kept_shards = [r.facts for r in caplog.records if r.event == "shard" and r.facts["kept"]]
    assert (os.stat(first).st_mtime_ns == kept) == any(
        facts["shard"] == first.name for facts in kept_shards
    )


def test_a_truncated_shard_is_made_again(once, recipe_path):
    before = checksums(once)
    whole = (once / "shard-00002.h5").read_bytes()
    (once / "shard-00002.h5").write_bytes(whole[: len(whole) // 2])
    generate(Recipe.load(recipe_path), once)
    assert checksums(once) == before


@pytest.mark.slow
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_signals_end_cleanly(recipe_path, tmp_path, number, code):
    out = tmp_path / "stopped"
    text = recipe_path.read_text().replace("scans: 2", "scans: 200")
    recipe_path.write_text(text)
    run = started(recipe_path, out, "--jobs", "2")
    wait_for_shards(out, 1, run)
    run.send_signal(number)
    _, errors = run.communicate(timeout=60)
    assert run.returncode == code
    assert "Traceback" not in errors
    assert "continues from there" in errors


def test_the_second_of_two_runs_says_so(once, recipe_path):
    from pipeline.dataset.folder import held

    mark = json.loads((once / ".flawforge" / "run.json").read_text())
    with held(once, mark["fingerprint"]), pytest.raises(RecipeError, match="another run"):
        generate(Recipe.load(recipe_path), once)


def test_a_folder_with_something_else_is_left_alone(once, recipe_path, tmp_path):
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "thesis.txt").write_text("x")
    with pytest.raises(RecipeError, match="isn't empty"):
        generate(Recipe.load(recipe_path), mine)
    before = checksums(once)
    recipe_path.write_text(recipe_path.read_text().replace("seed: 0", "seed: 1"))
    with pytest.raises(RecipeError, match="another recipe"):
        generate(Recipe.load(recipe_path), once)
    assert checksums(once) == before


def test_one_bad_part_doesnt_stop_the_others(recipe_path, tmp_path):
    folder = recipe_path.parent
    trimesh.creation.box(extents=(30, 30, 5)).subdivide().export(folder / "good.stl")
    (folder / "empty.stl").write_bytes(b"")
    text = recipe_path.read_text()
    text = text[: text.index("  - builtin")] + "  - path: '*.stl'\n" + text[text.index("flaws:") :]
    recipe_path.write_text(text.replace("splits: {train: 0.5, test: 0.5}\n", ""))
    said = generate(Recipe.load(recipe_path), tmp_path / "out")
    assert said["scans"] == 6
    (failed,) = said["failed"]
    assert failed["part"] == "empty"
    assert "empty.stl" in failed["why"]
    (folder / "good.stl").unlink()
    lines = recipe_path.read_text().splitlines()
    line = 1 + next(k for k, one in enumerate(lines) if "*.stl" in one)
    with pytest.raises(PartError, match=rf"{recipe_path.name}:{line}: no part can be used"):
        generate(Recipe.load(recipe_path), tmp_path / "none")


def test_depth_code_keeps_every_multiple_of_its_step():
    code = DepthCode(0.0038, 275.0, 525.0)
    assert code.dtype == np.uint32
    depth = (code.first + np.array([[0, 1, 65788]])) * 0.0038
    counts = code.encode(np.append(depth, [[np.nan]], axis=1))
    assert counts.tolist() == [[0, 1, 65788, code.missing]]
    np.testing.assert_allclose(code.offset_mm + counts[0, :3] * 0.0038, depth[0], atol=1e-12)


def test_very_many_scans_are_announced(recipe_path, tmp_path, monkeypatch, caplog):
    monkeypatch.setattr("pipeline.batch.run.MANY_SCANS", 3)
    monkeypatch.setattr("pipeline.batch.run.MANY_FLAWS", 2)
    sets = ["specimens=1", "scans=2", "splits={train: 1.0}"]
    with caplog.at_level("INFO", "flawforge.generate"):
        generate(Recipe.load(recipe_path, sets=sets), tmp_path / "out")
    said = [one.facts["text"] for one in caplog.records if one.event == "warning"]
    assert said == [
        "up to 3 flaws in a specimen, cut one by one: flawforge check predicts the time",
        "up to 4 scans: flawforge check predicts the time",
    ]
