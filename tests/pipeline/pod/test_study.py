"""A study joins a detector's table to the dataset's flaws; its page says the estimates."""

import json
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy.special import expit

from files.errors import RecipeError
from flawforge.cli import main
from pipeline.pod.study import make_study

COUNT = 400


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    folder = tmp_path_factory.mktemp("dataset")
    rng = np.random.default_rng(8)
    depth = np.exp(rng.uniform(np.log(0.05), np.log(1.0), COUNT))
    flaws = pd.DataFrame(
        {
            "scan_id": [f"s{i // 2}" for i in range(COUNT)],
            "specimen": [f"p{i // 4}" for i in range(COUNT)],
            "instance": [1 + i % 2 for i in range(COUNT)],
            "kind": np.where(np.arange(COUNT) % 4 < 2, "dent", "pit"),
            "split": np.where(np.arange(COUNT) < 300, "train", "test"),
            "pixels": np.where(np.arange(COUNT) % 10 == 9, 0, 20),
            "depth_mm": depth,
            "size_length_mm": 10 * depth,
            "response": 30 * depth * np.exp(0.2 * rng.standard_normal(COUNT)),
        }
    )
    flaws.to_parquet(folder / "flaws.parquet")
    said = {
        "format": "flawforge-dataset", "name": "pod", "scans": COUNT, "shards": {}, "files": {},
        "classes": {}, "versions": {}, "recipe": {"detectable_at": 5.0},
    }  # fmt: skip
    (folder / "dataset.json").write_text(json.dumps(said))
    found = rng.uniform(size=COUNT) < expit(3 * np.log(depth / 0.2))
    predictions = flaws[["scan_id", "instance"]].assign(detected=found)[found]
    predictions.sample(frac=1, random_state=1).to_parquet(folder / "hits.parquet")
    return SimpleNamespace(folder=folder, flaws=flaws, found=found)


def test_flaws_that_a_detector_does_not_name_were_missed(dataset):
    study = make_study(dataset.folder, predictions=dataset.folder / "hits.parquet")
    every = study.groups[0]
    shown = dataset.flaws["pixels"] > 0
    assert every.hit.tolist() == dataset.found[shown].tolist()
    curve = every.curves["hit/miss"]
    assert curve.estimate().a50 == pytest.approx(0.2, rel=0.15)
    assert [group.name for group in study.groups[1:]] == ["dent", "pit"]
    assert len(every.size) == len(study.groups[1].size) + len(study.groups[2].size)


def test_the_built_in_detector_has_both_curves_and_a_length_scales_its_sizes(dataset):
    by_depth = make_study(dataset.folder)
    by_length = make_study(dataset.folder, size="length_mm")
    for one in by_depth.groups[0].curves.values():
        assert one.estimate().a90 > one.estimate().a50
    signal = [s.groups[0].curves["signal response"].estimate().a90 for s in (by_depth, by_length)]
    assert signal[1] == pytest.approx(10 * signal[0], rel=1e-3)
    assert signal[0] == pytest.approx(5 / 30 * np.exp(1.2816 * 0.2), rel=0.05)
    assert len(make_study(dataset.folder, split="test").groups[0].size) == 90


def test_the_page_holds_the_estimates(dataset, tmp_path, capsys):
    page = tmp_path / "pod.html"
    assert main(["pod", str(dataset.folder), "--out", str(page)]) == 0
    facts = json.loads(page.with_suffix(".json").read_text())
    first = facts["groups"][0]["methods"]["hit/miss"]
    assert f"a90 {first['a90']:.3g}" in capsys.readouterr().out
    assert f"<td>{first['a90_95']:.3g}</td>" in page.read_text()
    assert first["a90"] < first["a90_95"]


def test_names_from_tables_are_text_on_the_page(dataset, tmp_path):
    names = ["<script>alert(1)<b>", "$^{$"]  # the second is no formula in the picture
    table = tmp_path / "<img src=x onerror=alert(2)>.parquet"
    evil = tmp_path / "evil"
    evil.mkdir()
    (evil / "dataset.json").write_text((dataset.folder / "dataset.json").read_text())
    kinds = np.where(dataset.flaws["kind"] == "dent", *names)
    dataset.flaws.assign(kind=kinds).to_parquet(evil / "flaws.parquet")
    pd.read_parquet(dataset.folder / "hits.parquet").to_parquet(table)
    page = tmp_path / "pod.html"
    assert main(["pod", str(evil), "--predictions", str(table), "--out", str(page)]) == 0
    text = page.read_text()
    assert "&lt;script&gt;alert(1)" in text
    assert names[1] in text
    assert "<script>alert" not in text
    assert "<img src=x" not in text


def test_wrong_tables_are_one_line(dataset, tmp_path):
    table = tmp_path / "t.parquet"
    with pytest.raises(RecipeError, match="none.parquet: no such file"):
        make_study(dataset.folder, predictions=tmp_path / "none.parquet")
    pd.DataFrame({"scan_id": ["s0"], "instance": [1]}).to_parquet(table)
    with pytest.raises(RecipeError, match="neither"):
        make_study(dataset.folder, predictions=table)
    pd.DataFrame({"scan_id": ["s0"], "instance": [1], "response": [2.0]}).to_parquet(table)
    with pytest.raises(RecipeError, match="threshold"):
        make_study(dataset.folder, predictions=table)
    pd.DataFrame({"scan_id": ["x"], "instance": [1], "detected": [True]}).to_parquet(table)
    with pytest.raises(RecipeError, match="no row names"):
        make_study(dataset.folder, predictions=table)
    with pytest.raises(RecipeError, match="size"):
        make_study(dataset.folder, size="kind")
