"""What holds for every form of export: repeatable bytes, choices, one-line errors, progress."""

import hashlib
import logging
import shutil
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from files.errors import RecipeError
from pipeline.dataset.export import FORMS, export
from pipeline.dataset.export.source import Source

NEEDS = {name: form.package for name, form in FORMS.items() if form.package}


def sums(folder: Path) -> dict[str, str]:
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.mark.parametrize("to", FORMS)
def test_a_second_run_gives_the_same_bytes(to: str, small_dataset: Path, tmp_path: Path) -> None:
    if to in NEEDS:
        pytest.importorskip(NEEDS[to])
    first = export(small_dataset, tmp_path / "a", to)
    export(small_dataset, tmp_path / "b", to)
    there = sums(tmp_path / "a")
    assert {str(path.relative_to(tmp_path / "a")) for path in first} == set(there)
    assert sums(tmp_path / "b") == there


def test_masks_and_instances_agree_and_hold_the_choice(small_dataset: Path) -> None:
    everything = list(Source.read(small_dataset).scans())
    visible = list(Source.read(small_dataset, mask="visible").scans())
    sizes = [np.bincount(s.instance.ravel())[1:] for s in everything]
    limit = int(max(size.max() for size in sizes if size.size))
    large = list(Source.read(small_dataset, min_pixels=limit).scans())
    for scan, seen, big in zip(everything, visible, large, strict=True):
        for one in (scan, seen, big):
            np.testing.assert_array_equal(one.mask > 0, one.instance > 0)
            assert [f["instance"] for f in one.flaws] == list(np.unique(one.instance))[1:]
        assert ((seen.mask > 0) <= (scan.mask > 0)).all()
        np.testing.assert_array_equal(scan.mask, scan.arrays["mask"])
        np.testing.assert_array_equal(seen.mask, scan.arrays["mask_visible"])
        counts = np.bincount(big.instance.ravel(), minlength=2)[1:]
        assert ((counts == 0) | (counts >= limit)).all()
    assert sum(len(one.flaws) for one in large) >= 1
    assert sum(len(one.flaws) for one in large) < sum(len(one.flaws) for one in everything)


def test_scans_and_splits_are_chosen(small_dataset: Path) -> None:
    manifest = pd.read_parquet(small_dataset / "manifest.parquet")
    test = Source.read(small_dataset, splits=["test"])
    assert [s.scan_id for s in test.scans()] == list(
        manifest[manifest["split"] == "test"]["scan_id"]
    )
    some = Source.read(small_dataset, scans=["plate-0001-0001", "plate-0000-0000"])
    assert [s.scan_id for s in some.scans()] == ["plate-0001-0001", "plate-0000-0000"]


def test_progress_counts_every_scan(
    small_dataset: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.INFO, logger="flawforge.export"):
        export(small_dataset, tmp_path, "png")
    events = [record.__dict__["event"] for record in caplog.records]
    assert events == ["plan", *["scan"] * 4]


@pytest.mark.parametrize(
    ("said", "arguments"),
    [
        (r"no such scan, got 'other'; allowed: plate-0000-0000", {"to": "ply", "scans": ["other"]}),
        (r"no such split, got 'vla'; allowed: t", {"to": "ply", "splits": ["vla"]}),
        (r"got 'stl'; allowed: recording, ply", {"to": "stl"}),
        (r"--mask: doesn't apply to --to recording", {"to": "recording", "mask": "all"}),
        (r"--image: doesn't apply to --to ply", {"to": "ply", "image": "relief8"}),
        (r"--min-pixels: too few, got 0; allowed: at least 1", {"to": "ply", "min_pixels": 0}),
    ],
)
def test_wrong_choices_are_said_in_one_line(
    said: str, arguments: dict[str, object], small_dataset: Path, tmp_path: Path
) -> None:
    with pytest.raises(RecipeError, match=said):
        export(small_dataset, tmp_path / "out", **arguments)  # type: ignore[arg-type]  # on purpose
    assert not (tmp_path / "out").exists(), "nothing is written"


def test_no_dataset_or_a_missing_shard_is_said_in_one_line(
    small_dataset: Path, tmp_path: Path
) -> None:
    with pytest.raises(RecipeError, match="no dataset here"):
        export(tmp_path, tmp_path / "b", "ply")
    for name in ("dataset.json", "manifest.parquet", "flaws.parquet"):
        shutil.copy(small_dataset / name, tmp_path)
    with pytest.raises(RecipeError, match=r"shard-00000\.h5: shard is missing or damaged"):
        export(tmp_path, tmp_path / "out", "png")


@pytest.mark.parametrize("to", NEEDS)
def test_an_absent_package_is_one_line(
    to: str, small_dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, str(NEEDS[to]), None)
    monkeypatch.delitem(sys.modules, f"pipeline.dataset.export.forms.{to}", raising=False)
    with pytest.raises(RecipeError, match=rf"needs the package {NEEDS[to]}.*flawforge\[{to}\]"):
        export(small_dataset, tmp_path / "out", to)
    assert not (tmp_path / "out").exists()
