"""COCO, YOLO and MVTec 3D-AD: every instance comes back point for point."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
import tifffile
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from PIL import Image
from scipy.ndimage import binary_fill_holes

import flawforge.dataset
from files.yaml_document import load_yaml
from pipeline.dataset.export import export
from pipeline.dataset.export.outline import outline


def filled(polygon: list[tuple[float, float]], shape: tuple[int, ...]) -> np.ndarray:
    """Points whose middle is inside by the even-odd rule (Haines, Graphics Gems IV, 1994)."""
    inside = np.zeros(shape, dtype=bool)
    y, x = np.mgrid[: shape[0], : shape[1]] + 0.5
    for (x0, y0), (x1, y1) in zip(polygon, [*polygon[1:], polygon[0]], strict=True):
        if y0 != y1:
            crosses = (y0 > y) != (y1 > y)
            inside ^= crosses & (x < (x1 - x0) * (y - y0) / (y1 - y0) + x0)
    return inside


@settings(deadline=None, max_examples=60)
@given(arrays(bool, st.tuples(st.integers(1, 9), st.integers(1, 9))))
def test_an_outline_filled_gives_the_points_back(here: np.ndarray) -> None:
    here[0, 0] = True
    polygon = outline(here)
    assert len(polygon) >= 4
    np.testing.assert_array_equal(filled(polygon, here.shape), binary_fill_holes(here))


def test_a_crack_one_point_wide_has_an_outline() -> None:
    crack = np.zeros((8, 8), dtype=bool)
    crack[np.arange(1, 7), np.arange(1, 7)] = True  # touches itself at corners alone
    np.testing.assert_array_equal(filled(outline(crack), crack.shape), crack)
    one = np.zeros((3, 3), dtype=bool)
    one[1, 1] = True
    assert sorted(outline(one)) == [(1, 1), (1, 2), (2, 1), (2, 2)]


# its own __array__ has no copy keyword
@pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")
def test_pycocotools_reads_the_coco(small_dataset: Path, tmp_path: Path) -> None:
    coco_tools = pytest.importorskip("pycocotools.coco")
    scans = flawforge.dataset.open(small_dataset)
    export(small_dataset, tmp_path, "coco")
    count = 0
    for split, size in scans.splits.items():
        coco = coco_tools.COCO(str(tmp_path / "annotations" / f"instances_{split}.json"))
        assert len(coco.getImgIds()) == size
        assert min(coco.getImgIds()) == min(coco.getAnnIds()) == 1
        assert {c["id"]: c["name"] for c in coco.loadCats(coco.getCatIds())} == {
            k: v for k, v in scans.classes.items() if k > 0
        }
        for image in coco.loadImgs(coco.getImgIds()):
            scan_id = Path(image["file_name"]).stem
            scan = scans[scan_id]
            with Image.open(tmp_path / split / image["file_name"]) as picture:
                assert picture.mode == "L"
                assert picture.size == (image["width"], image["height"])
            flaws = scans.flaws_of(scan_id).set_index("instance")
            seen = np.zeros_like(scan["instance"])
            for annotation in coco.loadAnns(coco.getAnnIds(imgIds=image["id"])):
                here = coco.annToMask(annotation) > 0
                number = int(annotation["flaw_id"].rsplit("/")[-1])
                seen[here] = number
                assert annotation["area"] == here.sum() > 0
                assert annotation["iscrowd"] == 0
                assert (scan["mask"][here] == annotation["category_id"]).all()
                assert annotation["depth_mm"] == flaws.loc[number, "depth_mm"]
                count += 1
            np.testing.assert_array_equal(seen, scan["instance"])
    assert count == (scans.flaws["pixels"] > 0).sum()


def test_the_yolo_files_keep_its_rules(small_dataset: Path, tmp_path: Path) -> None:
    """The rules of Ultralytics' loader, which brings a GPU stack: stated here instead.

    A line is a class and at least three corners; all between 0 and 1, the class below the number
    of names; labels stand at the picture's path with `images` replaced; no line stands twice.
    """
    scans = flawforge.dataset.open(small_dataset)
    export(small_dataset, tmp_path, "yolo", min_pixels=4)
    data = load_yaml(tmp_path / "data.yaml").data
    assert list(data["names"]) == list(range(len(data["names"])))
    lines = 0
    for split, count in scans.splits.items():
        pictures = sorted((tmp_path / data[split]).iterdir())
        assert len(pictures) == count
        for picture in pictures:
            scan = scans[picture.stem]
            label = Path(str(picture).replace("/images/", "/labels/")).with_suffix(".txt")
            rows = [line.split() for line in label.read_text().splitlines()]
            assert len({tuple(row) for row in rows}) == len(rows)
            sizes = np.bincount(scan["instance"].ravel())
            wanted = [n for n in range(1, len(sizes)) if sizes[n] >= 4]
            assert len(rows) == len(wanted)
            height, width = scan["mask"].shape
            for number, row in zip(wanted, rows, strict=True):
                corners = np.array(row[1:], dtype=float).reshape(-1, 2)
                assert len(corners) >= 3
                assert corners.min() >= 0
                assert corners.max() <= 1
                polygon = [(x * width, y * height) for x, y in corners]
                here = scan["instance"] == number
                np.testing.assert_array_equal(filled(polygon, here.shape), binary_fill_holes(here))
                kinds = {scans.classes[int(c)] for c in np.unique(scan["mask"][here])}
                assert kinds == {data["names"][int(row[0])]}
                lines += 1
    assert lines > 0


def test_the_mvtec_folders_keep_the_rules_of_their_readers(
    small_dataset: Path, tmp_path: Path
) -> None:
    """The rules of anomalib's MVTec3D reader, which brings a GPU stack: stated here instead.

    The last four parts of a path are split, label, type and name; each rgb has an xyz named by
    what stands before its first dot; each rgb of the test has a gt of the same name; training is
    good.
    """
    scans = flawforge.dataset.open(small_dataset)
    export(small_dataset, tmp_path, "mvtec3d")
    with (tmp_path / "scans.csv").open() as file:
        ids = {row["file"]: row["scan_id"] for row in csv.DictReader(file)}
    pictures = sorted(tmp_path.glob("*/*/*/rgb/*.png"))
    assert {str(path.relative_to(tmp_path)) for path in pictures} == set(ids)
    bad = 0
    for path in pictures:
        split, label = path.parts[-4:-2]
        scan = scans[ids[str(path.relative_to(tmp_path))]]
        xyz = tifffile.imread(path.parents[1] / "xyz" / f"{path.name.split('.')[0]}.tiff")
        assert xyz.dtype == np.float32
        assert xyz.shape == (*scan["mask"].shape, 3)
        valid = np.isfinite(scan["depth"])
        assert (xyz[~valid] == 0).all()
        np.testing.assert_allclose(xyz[valid], scans.points(scan["scan_id"]), rtol=0, atol=1e-5)
        with Image.open(path) as picture:
            assert picture.mode == "RGB"
        truth = np.asarray(Image.open(path.parents[1] / "gt" / path.name))
        assert set(np.unique(truth)) <= {0, 255}
        np.testing.assert_array_equal(truth > 0, scan["mask"] > 0)
        assert (label == "good") == (not truth.any())
        assert split == "test" or label == "good"
        bad += label != "good"
    flawed = [bool(scan["mask"].any()) for scan in scans]
    test = [split == "test" for split in scans.manifest["split"]]
    assert bad == sum(f and t for f, t in zip(flawed, test, strict=True)) > 0


def test_the_scale_of_a_dataset_is_one(small_dataset: Path, tmp_path: Path) -> None:
    export(small_dataset, tmp_path, "coco", image="depth16")
    said = [
        json.loads(path.read_text())["info"]["image"]
        for path in sorted((tmp_path / "annotations").iterdir())
    ]
    assert len(said) > 1
    assert all(one == said[0] for one in said)
