"""A trial: sealed tests, no draw shared with training, the same segmenter from the same seed."""

import json
from dataclasses import replace

import numpy as np
import pytest

from challenge.payoff import payoff as steps
from challenge.payoff import trial
from challenge.payoff.gap import TRAINED_ON, counted, outcome
from challenge.payoff.page import conclusion, write_page
from challenge.payoff.payoff import payoff
from challenge.payoff.precision import GROUPS
from challenge.payoff.segmenter import FEATURES, features, suspicion, train
from challenge.payoff.trial import Effort, fit, score
from challenge.payoff.worlds import WORLDS, ready, scan, specimen

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


def described(seed, blur=0.0):
    rng = np.random.default_rng(seed)
    made = [picture(rng, blur) for _ in range(EFFORT.training)]
    return [(features(depth), instance) for depth, instance in made]


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


def test_the_same_seed_trains_the_same_segmenter():
    scans = described(1)
    one, two = (train(scans, np.random.default_rng(4)) for _ in range(2))
    other = train(scans, np.random.default_rng(5))
    assert np.array_equal(suspicion(one, scans[0][0]), suspicion(two, scans[0][0]))
    assert not np.array_equal(suspicion(one, scans[0][0]), suspicion(other, scans[0][0]))


def test_equal_data_make_equal_segmenters_and_no_gap(sealed):
    """The three sets differ by their readings alone: with the same readings there is no gap."""
    same = described(1)
    models = fit({name: same for name in TRAINED_ON}, 9, EFFORT)
    assert len(models) == 3 * EFFORT.seeds
    found = score(models, *sealed)
    tallies = {
        field: np.stack(
            [
                [
                    [getattr(t, field) for t in found["points"][name, turn]]
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
    # pits of eight times the noise are found
    assert result.mean()[0].value > 0.95


def test_a_changed_test_recording_is_refused(sealed, tmp_path):
    folder, digests = sealed
    changed = {name: digest[::-1] for name, digest in digests.items()}
    with pytest.raises(ValueError, match="sealed"):
        score({}, folder, changed)


@pytest.mark.slow
def test_training_and_test_share_no_draw():
    world = ready("nothing", 3)
    train_path, test_path = (specimen(world, purpose, 0) for purpose in ("train", "test"))
    assert not np.allclose(train_path.path.start, test_path.path.start)
    assert [f.depth_mm for f in train_path.flaws] != [f.depth_mm for f in test_path.flaws]
    # the same solid and path again, scanned for training or for the test: other noise, other skin
    short = replace(train_path, path=replace(train_path.path, profiles=6))
    one, again, other = (scan(world, purpose, 0, short) for purpose in ("train", "train", "test"))
    assert np.array_equal(one, again, equal_nan=True)
    same = np.isfinite(one) & np.isfinite(other)
    assert (one != other)[same].mean() > 0.9


def test_a_run_of_another_plan_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(steps, "render", lambda *a: {})
    monkeypatch.setattr(steps, "run_world", lambda *a: None)
    monkeypatch.setattr(steps, "results", lambda out: {})
    payoff(tmp_path, seed=1, jobs=1, small=True, worlds=["print"])
    payoff(tmp_path, seed=None, jobs=1, small=True, worlds=["print"])
    with pytest.raises(ValueError, match="another"):
        payoff(tmp_path, seed=2, jobs=1, small=True, worlds=["print"])
    with pytest.raises(ValueError, match="--world: unknown"):
        payoff(tmp_path, seed=1, jobs=1, worlds=["moon"])


def test_the_page_says_what_the_tallies_say(tmp_path):
    rng = np.random.default_rng(2)
    arrays = {"seen": np.array([list(g) for g in GROUPS])}
    for k, name in enumerate(TRAINED_ON):
        arrays[f"shown/{name}"] = rng.random((20, 30)).astype(np.float32)
        for what in ("points", "flaws"):
            for turn in range(2):
                hits = np.zeros((4, len(GROUPS), 2000), np.int32)
                hits[..., 1500] = 20 + 30 * k
                hits[..., 10] = 80 - 30 * k
                false = np.zeros((4, 2000), np.int32)
                false[:, 700] = 500
                key = f"{what}/{name}/{turn}"
                arrays |= {f"{key}/hits": hits, f"{key}/false": false,
                           f"{key}/missed": np.zeros((4, len(GROUPS)), np.int32)}  # fmt: skip
    arrays["shown/depth"] = rng.normal(150, 0.01, (20, 30)).astype(np.float32)
    arrays["shown/instance"] = np.zeros((20, 30), np.int16)
    names = ["nothing", "print"]
    for name in names:
        (tmp_path / name / "diagnose").mkdir(parents=True)
        np.savez(tmp_path / name / "tallies.npz", **arrays)
        answer = {"verdict": "explained", "effects": ["reflectance_edge"]}
        (tmp_path / name / "diagnose" / "answer.json").write_text(json.dumps(answer))
    plan = {"seed": 1, "effort": {"training": 4, "test": 4, "seeds": 2}, "worlds": names}
    (tmp_path / "plan.json").write_text(json.dumps(plan))
    found = steps.results(tmp_path)
    assert counted(tmp_path / "print" / "tallies.npz", "points")["hits"].shape[:3] == (3, 2, 4)
    # halfway between 20 and 80 of 100 hits; what is missed still ranks after all false ones
    assert found["points"]["all"].closed().value == pytest.approx(0.5, abs=0.01)
    assert "closes 5" in conclusion(found)
    write_page(found, tmp_path, tmp_path / "docs" / "payoff.md")
    page = (tmp_path / "docs" / "payoff.md").read_text()
    assert "reflectance_edge" in page
    assert "gap not sure" not in page
    assert (tmp_path / "docs" / "pictures" / "payoff-examples.png").exists()


def test_every_world_names_a_switch_or_none():
    from challenge.cases.case import SWITCHES

    assert [w.switch for w in WORLDS.values() if w.switch not in SWITCHES] == [""]
    assert features(np.zeros((8, 8))).shape[-1] == FEATURES
    assert trial.SMALL.training < Effort().training


def test_where_the_diagnosis_has_no_answer_the_plain_sensor_stays(tmp_path, monkeypatch):
    (tmp_path / "stranger").mkdir()
    for file in trial.STRANGER:
        (tmp_path / "stranger" / file).write_text(f"the stranger's {file}")

    def no_answer(arguments, folder):
        if arguments[0] == "diagnose":
            raise ValueError("it failed")
        (folder / "roughness").mkdir()
        (folder / "roughness" / "surface.yaml").write_text("a surface")

    monkeypatch.setattr(trial, "flawforge", no_answer)
    trial.diagnose(tmp_path)
    there = tmp_path / "diagnose"
    assert (there / "diagnosed.yaml").read_text() == (there / "sensor.yaml").read_text()
    assert json.loads((there / "answer.json").read_text())["verdict"] == "no answer"
    # nothing but the stranger's files is within reach of the diagnosis
    assert {p.name for p in there.iterdir()} >= set(trial.STRANGER)
    assert not (there / "sealed").exists()
