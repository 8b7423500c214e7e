"""Pictures, TIFF, WebDataset and the hub's parquet give depth and labels back."""

import io
import json
from pathlib import Path

import numpy as np
import pytest
import tifffile
from PIL import Image

import flawforge.dataset
from pipeline.dataset.export import export
from pipeline.dataset.export.image import Coding
from pipeline.dataset.export.source import Source


def test_png_gives_depth_and_labels_back(small_dataset: Path, tmp_path: Path) -> None:
    scans = flawforge.dataset.open(small_dataset)
    export(small_dataset, tmp_path, "png")
    coding = json.loads((tmp_path / "image.json").read_text())
    classes = json.loads((tmp_path / "classes.json").read_text())
    assert {int(k): v for k, v in classes.items()} == scans.classes
    for split, count in scans.splits.items():
        assert len(list((tmp_path / split / "image").iterdir())) == count
    for number, scan in enumerate(scans):
        split, name = scans.manifest["split"][number], f"{scan['scan_id']}.png"
        image = np.asarray(Image.open(tmp_path / split / "image" / name))
        assert image.dtype == np.uint16
        depth = np.where(image == 0, np.nan, coding["offset_mm"] + coding["scale_mm"] * image)
        # written in counts of the sensor, read back to the bit of a float64
        np.testing.assert_allclose(depth, scan["depth"], rtol=0, atol=coding["scale_mm"] / 2)
        mask = Image.open(tmp_path / split / "mask" / name)
        assert mask.mode == "L"
        np.testing.assert_array_equal(np.asarray(mask), scan["mask"])
        # what a reader of anomalies does with it
        np.testing.assert_array_equal(np.asarray(mask.convert("L")) > 0, scan["mask"] > 0)
        instance = np.asarray(Image.open(tmp_path / split / "instance" / name))
        np.testing.assert_array_equal(instance, scan["instance"])


@pytest.mark.parametrize("kind", ["relief8", "depth16", "float32"])
def test_each_kind_of_picture_inverts(kind: str, small_dataset: Path) -> None:
    source = Source.read(small_dataset, image=kind)  # type: ignore[arg-type]  # parametrized
    coding = Coding.of(source)
    for scan in source.scans():
        numbers = np.asarray(Image.open(io.BytesIO(coding.file(scan))))
        np.testing.assert_array_equal(numbers, coding.array(scan))
        valid = np.isfinite(scan.depth_mm)
        if kind == "float32":
            np.testing.assert_array_equal(numbers, scan.depth_mm.astype(np.float32))
            continue
        np.testing.assert_array_equal(numbers > 0, valid)
        if kind == "depth16":
            depth = coding.offset_mm + coding.scale * numbers[valid].astype(float)
            assert np.abs(depth - scan.depth_mm[valid]).max() <= coding.scale / 2 + 1e-9
            continue
        from pipeline.dataset.relief import local_relief, pitch_mm

        relief = local_relief(scan.depth_mm, pitch_mm(scan.arrays))[valid]
        back = np.arcsinh(relief / coding.softening_mm) * coding.scale + 128
        assert np.abs(back - numbers[valid]).max() <= 0.5 + 1e-9


def test_tifffile_reads_the_tiff(small_dataset: Path, tmp_path: Path) -> None:
    scans = flawforge.dataset.open(small_dataset)
    written = export(small_dataset, tmp_path, "tiff")
    depths = [path for path in written if path.parent.name == "depth"]
    assert len(depths) == len(scans)
    for path in depths:
        scan = scans[path.stem]
        with tifffile.TiffFile(path) as file:
            tags = file.pages[0].tags
            np.testing.assert_array_equal(file.asarray(), scan["depth"].astype(np.float32))
            assert tags["ResolutionUnit"].value == 3, "centimetre"
            across, along = (tags[f"{a}Resolution"].value for a in "XY")
            assert tags[42113].value == "nan"
        # 60 profiles over 26 mm
        np.testing.assert_allclose(along[0] / along[1], 60 / 2.6, rtol=1e-3)
        x = np.sort(scan["ray_x_mm"] + np.nanmedian(scan["depth"]) * scan["ray_slope"])
        np.testing.assert_allclose(across[0] / across[1], 10 / np.median(np.diff(x)), rtol=1e-3)
        for name in ("mask", "instance"):
            labels = tifffile.imread(path.parents[1] / name / path.name)
            np.testing.assert_array_equal(labels, scan[name])


# the reader leaves the file open for the garbage collector
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning")
def test_webdataset_reads_the_tars(small_dataset: Path, tmp_path: Path) -> None:
    wds = pytest.importorskip("webdataset", exc_type=ImportError)
    scans = flawforge.dataset.open(small_dataset)
    export(small_dataset, tmp_path, "webdataset", image="depth16")
    for split, count in scans.splits.items():
        reader = wds.WebDataset(str(tmp_path / f"{split}-000000.tar"), shardshuffle=False)
        samples = list(reader.decode("pil"))
        assert len(samples) == count
        for sample in samples:
            facts = sample["json"]
            scan = scans[facts["scan_id"]]
            np.testing.assert_array_equal(np.asarray(sample["mask.png"].convert("L")), scan["mask"])
            assert {f["instance"] for f in facts["flaws"]} == set(np.unique(scan["instance"])) - {0}


def test_datasets_loads_the_hubs_folder(
    small_dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    datasets = pytest.importorskip("datasets")
    scans = flawforge.dataset.open(small_dataset)
    export(small_dataset, tmp_path / "hf", "hf", image="float32")
    loaded = datasets.load_dataset(str(tmp_path / "hf"), cache_dir=str(tmp_path / "cache"))
    assert {name: len(part) for name, part in loaded.items()} == scans.splits
    for part in loaded.values():
        assert isinstance(part.features["image"], datasets.Image)
        names = part.features["objects"]["category"].feature.names
        for row in part:
            scan = scans[row["scan_id"]]
            np.testing.assert_array_equal(
                np.asarray(row["image"]), scan["depth"].astype(np.float32)
            )
            np.testing.assert_array_equal(np.asarray(row["mask"]), scan["mask"])
            np.testing.assert_array_equal(np.asarray(row["instance"]), scan["instance"])
            for number, box, category, area in zip(
                *(row["objects"][key] for key in ("id", "bbox", "category", "area")), strict=True
            ):
                rows, columns = np.nonzero(scan["instance"] == number)
                assert area == rows.size
                assert box == [columns.min(), rows.min(), np.ptp(columns) + 1, np.ptp(rows) + 1]
                assert names[category] == scans.classes[int(scan["mask"][rows[0], columns[0]])]
