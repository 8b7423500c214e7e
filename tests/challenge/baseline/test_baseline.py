"""The data scientist's baseline: residuals, their figures, and a classifier on them."""

import json

import h5py
import numpy as np
import pytest
import yaml

from challenge.baseline.boosted import MATCH, answer_of, baseline
from challenge.baseline.features import features
from challenge.baseline.residuals import of_case
from challenge.cases.files import write_stl
from challenge.instrument.instrument import Solid
from challenge.judging.side_answers import BOOSTED

DISTANCE, PROFILES, POINTS, PITCH = 100.0, 80, 90, 0.1


def wedge():
    """Plane z = 0.1 y in the part's frame, seen from above, large enough for any scan."""
    corners = np.array([[x, y, 0.1 * y] for y in (-50.0, 50.0) for x in (-50.0, 50.0)])
    return Solid(vertices_mm=corners, faces=np.array([[0, 1, 2], [1, 3, 2]]))


def case(folder, rest, *, fan=False, recordings=3, noise_mm=0.004, seed=0):
    """Write a case whose readings are the plane, plus `rest(profile, point, x)` and noise."""
    folder.mkdir(parents=True)
    rng = np.random.default_rng(seed)
    x = (np.arange(POINTS) - (POINTS - 1) / 2) * PITCH
    k, j = np.mgrid[0:PROFILES, 0:POINTS]
    for number in range(recordings):
        pose = np.repeat(np.diag([1.0, -1.0, -1.0, 1.0])[None], PROFILES, axis=0)
        pose[:, 1, 3], pose[:, 2, 3] = 4.0 - PITCH * np.arange(PROFILES), DISTANCE
        # the sensor looks down: depth of z = 0.1 y under it, the fan's rays go on sideways only
        depth = np.broadcast_to(DISTANCE - 0.1 * pose[:, 1, 3][:, None], k.shape)
        depth = depth + rest(k, j, x[j]) + noise_mm * rng.standard_normal(k.shape)
        with h5py.File(folder / f"{'abc'[number]}.h5", "w") as out:
            out["depth"], out["intensity"] = depth, np.full(k.shape, 0.4)
            out["pose"], out["time"] = pose, np.arange(PROFILES) / 50.0
            out.attrs["start_time_s"] = 100.0 * number
            if not fan:
                out["x"] = x
    write_stl(folder / "part.stl", wedge())
    sheet = {"working_distance_mm": DISTANCE, "x_fov_mm": float(2 * x[-1])}
    (folder / "sensor.yaml").write_text(yaml.safe_dump(sheet))
    return folder


def nothing(k, j, x):
    del j, x
    return 0.0 * k


def shaken(k, j, x):
    del j, x
    return 0.006 * np.sin(2 * np.pi * 0.21 * k)


def bowed(k, j, x):
    del k, j
    return 0.01 * (x / 4.5) ** 2


@pytest.mark.parametrize("fan", [False, True])
def test_a_perfect_reading_has_no_residual(tmp_path, fan):
    found, good = of_case(case(tmp_path / "c", nothing, fan=fan, noise_mm=0.0))
    assert len(found) == 3
    assert good == []
    for r in found:
        np.testing.assert_allclose(r.rest_mm, 0.0, atol=1e-5)  # the STL has single precision


def test_figures_show_the_noise_and_nothing_else(tmp_path):
    got = features(case(tmp_path / "c", nothing))
    assert got["noise"] == pytest.approx(0.004, rel=0.05)
    assert got["size"] == pytest.approx(1.0, rel=0.05)
    assert abs(got["alike along the line"]) < 0.05
    assert got["lost off edges"] == 0.0
    assert abs(got["follows x²"]) < 0.05


def test_figures_show_a_vibration_at_its_frequency_and_a_bow_over_the_line(tmp_path):
    quiet, loud = (
        features(case(tmp_path / name, rest))
        for name, rest in (("q", nothing), ("l", shaken))
    )
    assert loud["rows, peak"] > 5 * quiet["rows, peak"]
    assert loud["rows, at"] == pytest.approx(0.21, abs=0.01)
    arc = features(case(tmp_path / "b", bowed))
    assert arc["follows x²"] > 0.4
    assert arc["columns alike"] > 0.8


def test_class_probabilities_become_an_answer():
    said = answer_of({MATCH: 0.1, "line_bow": 0.6, "form_error": 0.25, "range_scale": 0.05})
    assert said["verdict"] == "explained"
    assert [e["name"] for e in said["effects"]] == ["line_bow"]
    assert said["effects"][0]["alternatives"] == [{"name": "form_error", "probability": 0.25}]
    assert answer_of({MATCH: 0.6, "line_bow": 0.4}) == {"verdict": MATCH, "effects": []}


def test_a_classifier_tells_what_it_was_trained_on_and_goes_on_where_it_stopped(tmp_path):
    pytest.importorskip("sklearn")
    train, kinds = tmp_path / "train", {"": nothing, "stage_vibration": shaken, "line_bow": bowed}
    sets = []
    for name, rest in kinds.items():
        for k in range(8):
            folder = case(train / f"{name}-{k}", rest, recordings=2, seed=k)
            secret = {"switches": [name] if name else []}
            (folder / "truth.json").write_text(json.dumps({"secret": secret}))
            sets.append(folder.name)
    with pytest.raises(ValueError, match="calibrate"):
        baseline(tmp_path, train)
    (train / "population.json").write_text(json.dumps({"name": "p", "sets": sets}))
    for name, rest in kinds.items():
        case(tmp_path / "cases" / f"case-{name}", rest, recordings=2, seed=99)
    listed = {f"case-{name}": {} for name in kinds}
    (tmp_path / "commitments.json").write_text(json.dumps({"cases": listed}))
    assert baseline(tmp_path, train) == 0
    said = {
        name: json.loads((tmp_path / BOOSTED / f"case-{name}" / "diagnosis.json").read_text())
        for name in kinds
    }
    assert said[""]["verdict"] == "match"
    for name in ("stage_vibration", "line_bow"):
        assert said[name]["effects"][0]["name"] == name
        assert said[name]["trained_on"] == "p"
    before = (tmp_path / BOOSTED / "case-" / "features.json").stat().st_mtime_ns
    assert baseline(tmp_path, train) == 0
    assert (tmp_path / BOOSTED / "case-" / "features.json").stat().st_mtime_ns == before
