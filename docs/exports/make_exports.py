"""Make docs/exports.md: the quickstart in every form, opened by the program that it is for.

Run `python docs/exports/make_exports.py [FORM ...]` from the top of the checkout; with forms, only
their sections are made again. Each snippet runs in a separate process; its output follows it.
"""

import os
import subprocess
import sys
import tempfile
import textwrap
import venv
from collections.abc import Sequence
from pathlib import Path

import flawforge
from pipeline.dataset.export import FORMS

PAGE = Path(__file__).parents[1] / "exports.md"
HEAD = """\
# Export a dataset

Made by `make exports`; do not edit. The snippets ran on the quickstart, with two specimens of
each part and two more without flaws.

`flawforge export DIR --to FORM` writes a dataset in the form of another program, into
`DIR/export-FORM` or `--out`. A second run gives the same bytes. Options:

- `--mask all|visible`: label all points of a flaw (default), or those whose deviation exceeds
  `visible_at` standard deviations of the noise.
- `--min-pixels N`: omit flaws with fewer labelled points in a scan.
- `--image relief8|depth16|float32`: content of pictures. All pictures of a dataset share one scale,
  stated in a file beside them.
  - *relief8*: height above the waviness (Gaussian regression filter, ISO 16610-21 and -28, cutoff
    8 mm), 8 bits: `softening_mm * sinh((number - 128) / scale)`, 0 = missing. The scale is linear
    within the noise and logarithmic above: 8 bits hold a scratch and a step of the part.
  - *depth16*: `offset_mm + scale_mm * number`, 16 bits, 0 = missing.
  - *float32*: depth in mm, TIFF, NaN = missing.
- `--splits train,val` and `--scan ID`: scans to export.

Rows are profiles, columns points. A class has the same number in every dataset: 1 is dent, 2
crack, and so on as in [flaws.md](flaws.md). `pip install 'flawforge[FORM]'` brings the
packages of a form. From Python: `flawforge.export(dataset, out, "coco")`.

"""
SMALLER = {"specimens": 2, "good_specimens": 2, "scans": 2}
NOTES = {
    "coco": "Masks are compressed run lengths. Beyond COCO's keys an annotation has `flaw_id`"
    " (specimen and number: the same flaw in several scans), `depth_mm`, `snr`, `detectable`,"
    " `deviation_over_noise`.",
    "yolo": "A polygon runs along the borders between points, so it reproduces the labels exactly,"
    " and a single point has four corners. Pieces are joined by a bridge without width, and holes"
    " are filled. Ultralytics needs a GPU stack and did not run here; a test checks the files"
    " against the rules of its loader.",
    "mvtec3d": "Training and validation hold only good scans, as in the original; the recipe's"
    " `good_specimens` makes them. With `split_by: specimen` a part is in training and test."
    " anomalib needs a GPU stack and did not run here; a test checks the folders against the rules"
    " of its MVTec 3D reader, whose core is this snippet.",
    "hf": "The folder can be pushed to the hub unchanged; `val` is named `validation` there.",
    "webdataset": "A key is the scan's id, with dots written as %2E.",
    "tiff": "Resolution tags hold points per centimetre; GDAL's tag names NaN as missing.",
    "las": "Metres, scale 0.1 µm, part frame; `gps_time` is the profile's time.",
    "ply": "Part frame, mm; only floats, bytes and int32. The points are the scan's valid"
    " readings, whose share the manifest states, too.",
    "png": "Masks are 8-bit grey, the class; instances 16-bit grey.",
    "recording": "The files of an instrument and its sensor, for `flawforge diagnose` and for round"
    " trips.",
}
SNIPPETS = {
    "coco": """\
from pycocotools.coco import COCO

coco = COCO("annotations/instances_train.json")
names = {one["id"]: one["name"] for one in coco.loadCats(coco.getCatIds())}
flaw = coco.loadAnns(coco.getAnnIds())[0]
print(len(coco.getImgIds()), "pictures,", len(coco.getAnnIds()), "flaws")
print(names[flaw["category_id"]], flaw["flaw_id"], "bbox", flaw["bbox"])
print("mask", coco.annToMask(flaw).sum(), "points, area", flaw["area"])
""",
    "yolo": """\
from pathlib import Path

print(Path("data.yaml").read_text().partition("names")[0].strip())
label = next(path for path in sorted(Path("labels/train").iterdir()) if path.stat().st_size)
for line in label.read_text().splitlines():
    numbers = line.split()
    print(label.name, "class", numbers[0], "with", (len(numbers) - 1) // 2, "corners")
""",
    "mvtec3d": """\
from pathlib import Path
import tifffile

root = Path("car_door")
for folder in sorted(root.glob("*/*")):
    print(folder.relative_to(root), len(list((folder / "rgb").iterdir())))
for image in sorted(root.glob("test/*/rgb/*.png")):
    assert (image.parents[1] / "gt" / image.name).is_file()
    xyz = tifffile.imread(image.parents[1] / "xyz" / f"{image.stem}.tiff")
print("xyz", xyz.dtype, xyz.shape)
""",
    "hf": """\
from pathlib import Path
from datasets import load_dataset

loaded = load_dataset(str(Path.cwd()), cache_dir="cache")
print({name: len(split) for name, split in loaded.items()})
row = loaded["train"][0]
kinds = loaded["train"].features["objects"]["category"].feature.names
print(row["scan_id"], row["image"].mode, row["image"].size)
print([kinds[number] for number in row["objects"]["category"]])
""",
    "webdataset": """\
import webdataset

samples = list(webdataset.WebDataset("train-000000.tar", shardshuffle=False).decode("pil"))
print(len(samples), "scans, keys", sorted(key for key in samples[0] if not key.startswith("_")))
print(samples[0]["__key__"], samples[0]["png"].size, samples[0]["json"]["split"])
""",
    "tiff": """\
from pathlib import Path
import numpy, tifffile

path = sorted(Path("train/depth").iterdir())[0]
with tifffile.TiffFile(path) as file:
    depth, tags = file.asarray(), file.pages[0].tags
    print(path.name, depth.dtype, depth.shape, f"{numpy.nanmedian(depth):.3f} mm")
    pitch = [10 * tags[f"{axis}Resolution"].value[1] / tags[f"{axis}Resolution"].value[0]
             for axis in "XY"]
    print("pitch, mm:", *(f"{one:.4f}" for one in pitch), "missing:", tags[42113].value)
""",
    "las": """\
from pathlib import Path
import laspy

cloud = laspy.read(sorted(Path("train").iterdir())[0])
print("LAS", cloud.header.version, len(cloud.points), "points, scale", cloud.header.scales)
print("classes", sorted(set(cloud.classification)), "instances", sorted(set(cloud.instance)))
""",
    "ply": """\
from csv import DictReader
from json import loads
from pathlib import Path
import open3d

path, data = sorted(Path("train").iterdir())[0], Path("../quickstart")
points = open3d.t.io.read_point_cloud(str(path)).point
print("Open3D", open3d.__version__, "reads", len(points.positions), "points with", *sorted(points))
with open(data / "manifest.csv") as rows:
    row = next(row for row in DictReader(rows) if row["scan_id"] == path.stem)
recipe = loads((data / "dataset.json").read_text())["recipe"]
valid = float(row["share_valid"]) * recipe["profiles"] * recipe["points"]
print("manifest: share_valid * profiles * points =", valid)
""",
    "png": """\
import json
from pathlib import Path
import numpy
from PIL import Image

coding = json.loads(Path("image.json").read_text())
image = numpy.asarray(Image.open(sorted(Path("train/image").iterdir())[0]))
depth = numpy.where(image == 0, numpy.nan, coding["offset_mm"] + coding["scale_mm"] * image)
mask = Image.open(sorted(Path("train/mask").iterdir())[0])
print(f"depth {numpy.nanmin(depth):.3f} to {numpy.nanmax(depth):.3f} mm; mask", mask.mode,
      f"{(numpy.asarray(mask) > 0).mean():.3%} flawed")
""",
    "recording": """\
from pathlib import Path
import h5py

with h5py.File(sorted(Path(".").glob("*.h5"))[0]) as file:
    print(file.attrs["format"], {name: array.shape for name, array in file.items()})
""",
}
ELSEWHERE = {"ply": "open3d==0.20.0"}  # large readers, installed beside the project for one snippet


def interpreter(name: str, folder: Path) -> str:
    """Python that runs a form's snippet: ours, or one of a new environment with its reader."""
    if name not in ELSEWHERE:
        return sys.executable
    home = folder / f"{name}-environment"
    venv.create(home, with_pip=True)
    python = str(home / "bin" / "python")
    subprocess.run([python, "-m", "pip", "install", "--quiet", ELSEWHERE[name]], check=True)
    return python


def written_sections() -> dict[str, str]:
    """Return the page's sections by form, as they are."""
    _, *sections = PAGE.read_text(encoding="utf-8").split("\n## ")
    return {section.partition("\n")[0]: f"## {section.strip()}\n" for section in sections}


def main(only: Sequence[str]) -> None:
    """Generate, export, open, write; `only` some forms: the others stay as they are."""
    sections = written_sections() if only else {}
    environment = {**os.environ, "HF_HUB_OFFLINE": "1", "HF_HUB_DISABLE_PROGRESS_BARS": "1"}
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder) / "quickstart"
        flawforge.generate("quickstart", data, sets=SMALLER)
        for name in only or SNIPPETS:
            out = Path(folder) / name
            written = flawforge.export(data, out, name)
            run = subprocess.run(
                [interpreter(name, Path(folder)), "-W", "ignore", "-c", SNIPPETS[name]],
                cwd=out, env=environment, capture_output=True, text=True, check=False,
            )  # fmt: skip
            assert run.returncode == 0, run.stderr
            said = "\n".join(
                line for line in run.stdout.splitlines()
                if not line.startswith(("loading", "Done", "creating", "index created"))
            )  # fmt: skip
            summary = FORMS[name].summary
            sections[name] = (
                f"## {name}\n\n{len(written)} files: {summary}.\n\n"
                + textwrap.fill(NOTES[name], 100)
                + f"\n\n```python\n{SNIPPETS[name]}```\n\n```\n{said}\n```\n"
            )
    page = "\n".join([HEAD, *(sections[name] for name in SNIPPETS)])
    PAGE.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
