"""A trial: sealed tests, no draw shared with training, the same segmenter from the same seed."""

import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from challenge.payoff import payoff as steps
from challenge.payoff import trial
from challenge.payoff.family import CONTROL
from challenge.payoff.gap import KINDS, TRAINED_ON, counted, outcome
from challenge.payoff.page import conclusions, sections_of, write_page
from challenge.payoff.payoff import payoff
from challenge.payoff.precision import GROUPS
from challenge.payoff.segmenter import FEATURES, features
from challenge.payoff.trial import FAMILIES, SEGMENTERS, Effort, fit, score

pytest.importorskip("sklearn")
EFFORT = Effort(training=4, test=2, seeds=2)


def picture(rng, blur=0.0):
    """Make a noisy plane with pits, and its labels."""
    depth = rng.normal(150, 0.01, (60, 80))
    instance = np.zeros(depth.shape, np.int16)
    for k in range(4):
        row, column = rng.integers(6, 54), rng.integers(6 + 18 * k, 18 + 18 * k)
        depth[row - 3 : row + 4, column - 3 : column + 4] += 0.08 - blur
        instance[row - 3 : row + 4, column - 3 : column + 4] = k + 1
    return depth.astype(np.float32), instance


def described(kind, seed, blur=0.0):
    if kind == "convolutional":
        pytest.importorskip("torch", reason="torch isn't installed: flawforge[payoff]")
    rng = np.random.default_rng(seed)
    made = [picture(rng, blur) for _ in range(EFFORT.training)]
    return [(SEGMENTERS[kind].describe(depth), instance) for depth, instance in made]


@pytest.fixture(scope="module")
def sealed(tmp_path_factory):
    """Two sealed pictures and their digests."""
    import hashlib

    folder = tmp_path_factory.mktemp("world")
    (folder / "sealed").mkdir()
    digests = {}
    for k in range(EFFORT.test):
        depth, instance = picture(np.random.default_rng(100 + k))
        file = folder / "sealed" / f"{k:03d}.npz"
        flaws = json.dumps([["pit", "small"]] * 4)
        np.savez(file, depth=depth, instance=instance, flaws=np.array(flaws))
        digests[file.name] = hashlib.sha256(file.read_bytes()).hexdigest()
    return folder, digests


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_seed_trains_the_same_segmenter(kind, monkeypatch):
    monkeypatch.setattr(trial.convolutional, "STEPS", 3)
    scans, method = described(kind, 1), SEGMENTERS[kind]
    one, two = (method.train(scans, np.random.default_rng(4)) for _ in range(2))
    other = method.train(scans, np.random.default_rng(5))
    found = [method.suspicion(model, scans[0][0]) for model in (one, two, other)]
    assert found[0].shape == scans[0][1].shape
    assert np.array_equal(found[0], found[1])
    assert not np.array_equal(found[0], found[2])


@pytest.mark.parametrize("kind", KINDS)
def test_equal_data_make_equal_segmenters_and_no_gap(sealed, kind, monkeypatch):
    """The sets differ by their readings alone: with the same readings there is no gap."""
    monkeypatch.setattr(trial.convolutional, "STEPS", 3)
    same = described(kind, 1)
    models = fit(kind, {name: same for name in TRAINED_ON}, 9, EFFORT)
    assert len(models) == len(TRAINED_ON) * EFFORT.seeds
    found = score(models, *sealed)
    tallies = {
        field: np.stack(
            [
                [
                    [getattr(t, field) for t in found["points"][kind, name, turn]]
                    for turn in range(EFFORT.seeds)
                ]
                for name in TRAINED_ON
            ]
        )
        for field in ("hits", "false", "missed")
    }
    result = outcome(tallies, 1, draws=30)
    assert result.gap().value == 0
    assert result.closed() is None
    if kind == "boosted":  # pits of eight times the noise are found
        assert result.mean()[0].value > 0.95


@pytest.mark.slow
def test_what_has_no_label_trains_no_network(monkeypatch):
    """Points labelled -1 count neither way: the network finds pits that it saw unlabelled."""
    monkeypatch.setattr(trial.convolutional, "STEPS", 40)
    scans = described("convolutional", 1)
    unlabelled = [(image, np.where(label > 2, -1, label)) for image, label in scans]
    method = SEGMENTERS["convolutional"]
    model = method.train(unlabelled, np.random.default_rng(1))
    points = np.mean([method.suspicion(model, image)[label > 2].mean() for image, label in scans])
    quiet = np.mean([method.suspicion(model, image)[label == 0].mean() for image, label in scans])
    assert points > 2 * quiet


def test_a_changed_test_recording_is_refused(sealed, tmp_path):
    folder, digests = sealed
    changed = {name: digest[::-1] for name, digest in digests.items()}
    with pytest.raises(ValueError, match="sealed"):
        score({}, folder, changed)


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_training_and_test_share_no_draw(family):
    of = FAMILIES[family]
    world = of.ready(CONTROL, 3)
    one, other = (of.specimen(world, purpose, 0) for purpose in ("train", "test"))
    assert not np.allclose(one.sight.start, other.sight.start)
    assert [f.depth_mm for f in one.flaws] != [f.depth_mm for f in other.flaws]
    # the same solid and path again, scanned for training or for the test: other noise, other skin
    name = "path" if family == "first" else "travel"
    path = replace(getattr(one.sight, name), profiles=6)
    short = replace(one, sight=replace(one.sight, **{name: path}))
    first, again, tested = (of.scan(world, p, 0, short) for p in ("train", "train", "test"))
    assert np.array_equal(first, again, equal_nan=True)
    same = np.isfinite(first) & np.isfinite(tested)
    assert (first != tested)[same].mean() > (0.9 if family == "first" else 0.3)  # coarse counts


def test_a_run_of_another_plan_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(steps, "render", lambda *a: {})
    monkeypatch.setattr(steps, "run_world", lambda *a: None)
    monkeypatch.setattr(steps, "results", lambda out: {})
    payoff(tmp_path, seed=1, jobs=1, small=True, worlds=["print"])
    payoff(tmp_path, seed=None, jobs=1, small=True, worlds=["print"])
    with pytest.raises(ValueError, match="another"):
        payoff(tmp_path, seed=1, jobs=1, small=True, worlds=["print"], family="second")
    with pytest.raises(ValueError, match="--family: unknown"):
        payoff(tmp_path, seed=1, jobs=1, small=True, family="third")
    with pytest.raises(ValueError, match="another"):
        payoff(tmp_path, seed=2, jobs=1, small=True, worlds=["print"])
    with pytest.raises(ValueError, match="--world: unknown"):
        payoff(tmp_path, seed=1, jobs=1, worlds=["moon"])


def fake_run(folder, family, answer):
    """Write what a run leaves: the sets find 20, 20, 50, 50 and 80 of 100 points of each group."""
    rng = np.random.default_rng(2)
    arrays = {"seen": np.array([list(g) for g in GROUPS])}
    for kind in KINDS:
        for name, found in zip(TRAINED_ON, (20, 20, 50, 50, 80), strict=True):
            arrays[f"shown/{kind}/{name}"] = rng.random((20, 30)).astype(np.float32)
            for what in ("points", "flaws"):
                for turn in range(2):
                    hits = np.zeros((4, len(GROUPS), 2000), np.int32)
                    hits[..., 1500] = found
                    hits[..., 10] = 100 - found
                    false = np.zeros((4, 2000), np.int32)
                    false[:, 700] = 500
                    key = f"{kind}/{what}/{name}/{turn}"
                    arrays |= {f"{key}/hits": hits, f"{key}/false": false,
                               f"{key}/missed": np.zeros((4, len(GROUPS)), np.int32)}  # fmt: skip
    arrays["shown/depth"] = rng.normal(150, 0.01, (20, 30)).astype(np.float32)
    arrays["shown/instance"] = np.zeros((20, 30), np.int16)
    names = [CONTROL, "print"]
    for name in names:
        (folder / name / "diagnose").mkdir(parents=True)
        np.savez(folder / name / "tallies.npz", **arrays)
        (folder / name / "diagnose" / "answer.json").write_text(json.dumps(answer))
    plan = {"seed": 1, "effort": {"training": 4, "test": 4, "seeds": 2}, "worlds": names,
            "family": family, "commit": f"the {family} commit"}  # fmt: skip
    (folder / "plan.json").write_text(json.dumps(plan))


def test_the_page_says_what_the_tallies_say(tmp_path, monkeypatch):
    monkeypatch.setattr(steps, "outcome", partial(outcome, draws=20))
    page = tmp_path / "docs" / "payoff.md"
    assert sections_of(page) == dict.fromkeys(FAMILIES, "Not run yet.")
    fake_run(tmp_path / "1", "first", {"verdict": "match", "effects": []})
    found = steps.results(tmp_path / "1")
    tallies = counted(tmp_path / "1" / "print" / "tallies.npz", KINDS[0], "points")
    assert tallies["hits"].shape[:3] == (len(TRAINED_ON), 2, 4)
    # halfway between 20 and 80 of 100 hits; what is missed still ranks after all false ones
    result = found["outcomes"][KINDS[0], "points"]["all"]
    assert result.closed().value == pytest.approx(0.5, abs=0.01)
    assert result.closed("noise").value == pytest.approx(0.0, abs=0.01)
    said = " ".join(conclusions(found))
    assert "closes 5" in said
    assert "is missed" in said
    assert "The control does not alarm: match." in said
    write_page(found, tmp_path / "1", page)
    assert "gap not sure" not in page.read_text()
    assert "Not run yet." in page.read_text()
    assert "Not finished" not in page.read_text()
    before = sections_of(page)["first"]

    alarm = {"verdict": "explained", "effects": ["reflectance_edge"]}
    fake_run(tmp_path / "2", "second", alarm)
    found = steps.results(tmp_path / "2")
    assert "The control alarms: explained (reflectance_edge)." in conclusions(found)
    write_page(found, tmp_path / "2", page)
    text = page.read_text()
    assert sections_of(page)["first"] == before
    assert "the second commit" in text
    assert "the first commit" in text
    assert "Not run yet." not in text
    (tmp_path / "2" / "print" / "tallies.npz").unlink()
    write_page(steps.results(tmp_path / "2"), tmp_path / "2", page)
    assert "Not finished: the worlds print." in page.read_text()
    for family in FAMILIES:
        assert (tmp_path / "docs" / "pictures" / f"payoff-{family}-examples.png").exists()
        assert f"pictures/payoff-{family}-precision.png" in text


def test_every_world_names_a_switch_or_none():
    from challenge.cases.case import SWITCHES
    from challenge.second.switches import FAULTS

    for family, switches in (("first", SWITCHES), ("second", FAULTS)):
        worlds = FAMILIES[family].WORLDS
        assert [n for n, w in worlds.items() if w.switch not in switches] == [CONTROL]
        assert len(worlds) >= 6
    assert features(np.zeros((8, 8))).shape[-1] == FEATURES
    assert trial.SMALL.training < Effort().training


def test_where_the_diagnosis_has_no_answer_the_plain_sensor_stays(tmp_path, monkeypatch):
    (tmp_path / "stranger").mkdir()
    for file in trial.STRANGER:
        (tmp_path / "stranger" / file).write_text(f"the stranger's {file}")

    def no_answer(arguments, folder):
        if arguments[0] == "diagnose":
            raise ValueError("it failed")
        into = folder / arguments[arguments.index("--out") + 1]
        into.mkdir()
        (into / "surface.yaml").write_text(f"a surface, {into.name}")

    monkeypatch.setattr(trial, "flawforge", no_answer)
    (tmp_path / "stranger" / "base-1.h5").write_text("a baseline")
    trial.diagnose(tmp_path, ["base-1"])
    there = tmp_path / "diagnose"
    assert (there / "diagnosed.yaml").read_text() == (there / "sensor.yaml").read_text()
    assert json.loads((there / "answer.json").read_text())["verdict"] == "no answer"
    # nothing but the stranger's files is within reach of the diagnosis
    assert {p.name for p in there.iterdir()} >= set(trial.STRANGER)
    assert (there / "base-1.h5").exists()
    assert (there / "surface.yaml").read_text() == "a surface, roughness"
    assert (there / "noise.yaml").read_text() == "a surface, noise"
    assert not (there / "sealed").exists()
