"""YOLO instance segmentation: a polygon for each flaw, pictures and labels by split."""

from collections.abc import Iterator
from pathlib import Path

from files.whole_file import write_whole
from files.yaml_document import dump_yaml
from pipeline.dataset.export.image import Coding
from pipeline.dataset.export.outline import outline
from pipeline.dataset.export.source import Labelled, Source
from pipeline.dataset.export.texts import write_json


def write(source: Source, out: Path) -> Iterator[Path]:
    """Write `images/SPLIT/ID.png`, `labels/SPLIT/ID.txt`, `data.yaml` and `image.json`.

    Classes count from 0 in the order of the dataset's. A polygon has no holes: YOLO has none.
    """
    coding = Coding.of(source)
    index = {number: at for at, number in enumerate(source.classes)}
    yield write_json(out / "image.json", coding.facts)
    path = out / "data.yaml"
    splits = {split: f"images/{split}" for split in source.splits}
    names = {at: source.classes[number] for number, at in index.items()}
    # without `path:`, the paths count from this file's folder
    text = dump_yaml({**splits, "names": names}).replace("'", "")
    write_whole(path, text, synced=False)
    yield path
    for scan in source.scans():
        picture = out / "images" / scan.split / f"{scan.scan_id}{coding.suffix}"
        labels = out / "labels" / scan.split / f"{scan.scan_id}.txt"
        for file in (picture, labels):
            file.parent.mkdir(parents=True, exist_ok=True)
        write_whole(picture, coding.file(scan), synced=False)
        text = "".join(line + "\n" for line in _lines(scan, index))
        write_whole(labels, text, synced=False)
        yield picture
        yield labels


def _lines(scan: Labelled, index: dict[int, int]) -> Iterator[str]:
    height, width = scan.mask.shape
    for flaw in scan.flaws:
        polygon = outline(scan.instance == int(flaw["instance"]))
        numbers = [f"{x / width:.8g} {y / height:.8g}" for x, y in polygon]
        yield f"{index[int(flaw['class_id'])]} " + " ".join(numbers)
