"""Make docs/datasets.md and its pictures: every figure in it is measured here.

Run `python docs/datasets/make_datasets.py` from the top of the checkout: about five minutes.
"""

import contextlib
import io
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
from jinja2 import Environment, StrictUndefined
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from measure_aim import MOTION, SCANS, SEEDS
from measure_aim import table as aim_table

import flawforge
import flawforge.dataset
from flawforge.cli import main
from pipeline.batch.splits import Unit, assign

HERE = Path(__file__).parent
STUDY = {
    "name": "pod-study", "seed": 5, "sensor": "KEYENCE-LJ-X8200", "triangulation_angle_deg": 30,
    "surface": "steel_plate", "profiles": 240, "points": 512, "specimens": 12, "scans": 8,
    "parts": [{"builtin": "steel_plate"}],
    "flaws": {
        "min_distance_mm": 2,
        "dent": {"number": 4, "length_mm": {"log_uniform": [2, 12]},
                 "depth_mm": {"log_uniform": [0.02, 0.5]}},
        "pit": {"number": 4},
    },
    "motion": {"length_mm": 40, "yaw_deg": {"uniform": [-20, 20]}, "aim_at_flaws": 1},
}  # fmt: skip


def said(*words: str) -> str:
    """Return what a command prints."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()):
        main(words)
    return out.getvalue().rstrip()


def split_rows() -> list[str]:
    """Return the shares that units come to, wanted and met."""
    shares = {"train": 0.6, "val": 0.2, "test": 0.2}
    rows = []
    for count in (3, 5, 12, 97):
        units = {f"u{i}": Unit(scans=1, labels={"crack": float(i % 4 == 0)}) for i in range(count)}
        chosen = list(assign(shares, 1, units).values())
        met = " / ".join(f"{chosen.count(split) / count:.0%}" for split in shares)
        cracks = [
            sum(units[name].labels["crack"] for name, split in assign(shares, 1, units).items()
                if split == wanted)
            for wanted in shares
        ]  # fmt: skip
        rows.append(f"| {count} | {met} | " + " / ".join(f"{c:.0f}" for c in cracks) + " |")
    return rows


def hidden_dent(folder: Path) -> dict[str, float | str]:
    """Draw the flaw with the largest ratio among those without a visible pixel."""
    flaws = pd.read_parquet(folder / "flaws.parquet")
    row = flaws[(flaws["pixels"] > 0) & (flaws["pixels_visible"] == 0)].nlargest(1, "snr").iloc[0]
    data = flawforge.dataset.open(folder)
    number = [scan["scan_id"] for scan in data.manifest.to_dict("records")].index(row["scan_id"])
    scan = data[number]
    off = (scan["depth"] - scan["depth_clean"]) * 1000
    true = (scan["depth_ideal"] - scan["depth_clean"]) * 1000
    figure = Figure(figsize=(9.0, 3.2), layout="constrained")
    FigureCanvasAgg(figure)
    span = np.nanpercentile(np.abs(off), 98)
    left, right = figure.subplots(1, 2)
    for axes, values, title in (
        (left, off, "reading less the unflawed part"),
        (right, true, "the same without noise"),
    ):
        shown = axes.imshow(values, cmap="RdBu_r", vmin=-span, vmax=span, aspect="auto")
        axes.set_title(title, fontsize=10)
        axes.set_xlabel("point")
        axes.set_ylabel("profile")
        first = (row["bbox_point_first"], row["bbox_profile_first"])
        size = (row["bbox_point_end"] - first[0], row["bbox_profile_end"] - first[1])
        from matplotlib.patches import Rectangle

        axes.add_patch(Rectangle(first, *size, fill=False, ec="0.2", lw=1.2))
    figure.colorbar(shown, ax=[left, right], label="µm")
    figure.savefig(HERE / "detectability.png", dpi=110, metadata={"Software": None})
    return {key: row[key] for key in ("kind", "pixels", "snr", "response", "deviation_max_mm")}


def planned(folder: Path) -> dict[str, str]:
    """Plan a part that has faces which nothing sees; keep the picture."""
    words = ("plan", "bearing_cap", "--sensor", "KEYENCE-LJ-X8200", "--angle", "30",
             "--surface", "steel_plate")  # fmt: skip
    printed = said(*words, "--out", str(folder / "plan"))
    (HERE / "plan.png").write_bytes((folder / "plan" / "plan.png").read_bytes())
    printed = printed.replace(f"{folder}", "out")
    return {"words": " ".join(words) + " --out out/plan", "printed": printed}


def brightness(folder: Path) -> dict[str, float]:
    """Return how far the brightness of flaws stands off from that of the part around them."""
    recipe = {
        **STUDY, "name": "brightness", "specimens": 2, "scans": 4, "intensity": {},
        "flaws": {"dent": {"number": 2, "length_mm": 8, "depth_mm": 0.5}},
    }  # fmt: skip
    flawforge.generate(recipe, folder / "brightness")
    data = flawforge.dataset.open(folder / "brightness")
    flawed, clean, saturated = [], [], []
    for scan in data:
        bright, returned = scan["intensity"].astype(float), np.isfinite(scan["depth"])
        on = scan["instance"] > 0
        flawed.append(bright[on & returned])
        clean.append(bright[~on & returned])
        saturated.append(bright[returned] == 255)
    on_flaw, off_flaw = np.concatenate(flawed), np.concatenate(clean)
    return {
        "points": len(on_flaw), "flawed_mean": on_flaw.mean(), "flawed_sd": on_flaw.std(),
        "clean_mean": off_flaw.mean(), "clean_sd": off_flaw.std(),
        "saturated": np.concatenate(saturated).mean(),
    }  # fmt: skip


def calibration(folder: Path) -> dict[str, float]:
    """Return how far responses scatter about their ratio, in their own standard deviations."""
    flaws = pd.read_parquet(folder / "flaws.parquet")
    flaws = flaws[flaws["snr"].between(0.01, 50)]
    off = flaws["response"] - flaws["snr"]
    return {"count": len(off), "mean": float(off.mean()), "sd": float(off.std())}


def make() -> None:
    """Measure, draw and write."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        check = said("check", "quickstart", "--jobs", "2")
        made = said("generate", "quickstart", "--out", str(folder / "quickstart"))
        flawforge.generate(STUDY, folder / "study")
        pod = said("pod", str(folder / "study"), "--out", str(folder / "pod.html"))
        (HERE / "pod.png").write_bytes((folder / "pod.png").read_bytes())
        template = Environment(undefined=StrictUndefined, keep_trailing_newline=True).from_string(
            (HERE / "datasets.md.j2").read_text(encoding="utf-8")
        )
        text = template.render(
            aim=aim_table(), aim_scans=SCANS, aim_seeds=SEEDS, aim_motion=MOTION.rstrip(),
            splits=split_rows(), check=check, made=made.replace(f"{folder}", "out"),
            pod=pod.replace(f"{folder}", "out"), dent=hidden_dent(folder / "study"),
            calibration=calibration(folder / "study"), study=STUDY, plan=planned(folder),
            brightness=brightness(folder),
        )  # fmt: skip
    (HERE.parent / "datasets.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    make()
