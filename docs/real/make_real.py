"""Diagnose real recordings of public sensors; fill in the figures of docs/real-recordings.md.

    python docs/real/make_real.py SHARED_FOLDER [keypad cylinder panel solids strip]

The recordings are SICK AppSpace samples. The CAD of their parts isn't public: the nominal shapes of
keypad and cylinder lie beside their recordings, the others are inferred, see nominal.py. What an
engineer reads off a recording stands in the page; no diagnosis sees it.
"""

import argparse
import base64
import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from typing import Any

import trimesh
from nominal import nominal, plate

from sensors.recording import Recording

HERE = Path(__file__).parent
PAGE = HERE.parent / "real-recordings.md"
PICTURE = "residual before and after"
FIGURES = (
    ("RMS, µm", "rms_um", "{:.1f}"),
    ("log score, nats per reading (lower is better)", "log_score", "{:.3f}"),
    ("share inside the 50 % interval", "coverage_50", "{:.2f}"),
    ("share inside the 90 % interval", "coverage_90", "{:.2f}"),
    ("missing readings, Brier score", "missing_brier", "{:.5f}"),
)
SCANS = 3
"""Proposed scans that the page shows."""


@dataclass(frozen=True, kw_only=True)
class Inferred:
    """One recording on its grid, whose nominal shape is inferred.

    Attributes
    ----------
    source : file in the shared folder's real/sick
    shape : builds the nominal shape
    window : profiles and points that are looked at; all without one
    """

    source: str
    shape: Callable[[Recording], trimesh.Trimesh]
    window: tuple[slice, slice] = (slice(None), slice(None))

    def arguments(self, real: Path, out: Path, name: str) -> list[str]:
        """Import, build the nominal shape, return the arguments of `flawforge diagnose`."""
        scan, sheet, part = out / f"{name}.h5", out / "sensor.yaml", out / "nominal.stl"
        _flawforge(
            "import", str(real / "sick" / self.source), "--as", str(scan),
            "--sensor-out", str(sheet),
        )  # fmt: skip
        recording = self._cut(Recording.load(scan))
        recording.save(scan)
        self.shape(recording).export(part)
        return [str(scan), "--part", str(part), "--sensor", str(sheet)]

    def _cut(self, recording: Recording) -> Recording:
        """Return the part of a recording within the window."""
        rows, columns = self.window
        assert recording.x_mm is not None
        assert recording.intensity is not None
        return replace(
            recording,
            depth_mm=recording.depth_mm[rows, columns],
            intensity=recording.intensity[rows, columns],
            poses=recording.poses[rows],
            time_s=recording.time_s[rows] - recording.time_s[rows][0],
            x_mm=recording.x_mm[columns],
        )


@dataclass(frozen=True, kw_only=True)
class Given:
    """Recordings that come with part, sensor's file and surface's file; the last is held out.

    Attributes
    ----------
    folder : in the shared folder's real/cases
    """

    folder: str

    def arguments(self, real: Path, out: Path, name: str) -> list[str]:
        """Return the arguments of `flawforge diagnose`, with baselines and plates as there are."""
        case = real / "cases" / self.folder
        found = [*(str(p) for p in sorted(case.glob("*.h5")))]
        for option, inside in (("--baseline", "baselines"), ("--reference", "plates")):
            files = sorted((case / inside).glob("*.h5"))
            found += [option, *map(str, files)] if files else []
        for option, file in (("part", "stl"), ("sensor", "yaml"), ("surface", "yaml")):
            found += [f"--{option}", str(case / f"{option}.{file}")]
        return found


CASES: dict[str, Inferred | Given] = {
    "keypad": Given(folder="keypad"),
    "cylinder": Given(folder="cylinder"),
    # where nothing but the plate lies below: most of the dark table returns no light
    "solids": Inferred(
        source="BlobFeatureTypes3D_image.json",
        shape=lambda r: nominal(r, (199.5, 201.5), table=True),
        window=(slice(420, 745), slice(45, 715)),
    ),
    # the panel alone, without the label, the figures and what it lies on
    "panel": Inferred(
        source="OCR_3D_image_42.json", shape=plate, window=(slice(10, 285), slice(250, 640))
    ),
    "strip": Inferred(
        source="StripGroove_image_9.json", shape=lambda r: nominal(r, (62.0, 63.0), table=False)
    ),
}


def main() -> None:
    """Diagnose each case; keep its diagnosis.json, its picture, and its figures in the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("shared", type=Path, metavar="SHARED_FOLDER")
    parser.add_argument("names", nargs="*", metavar="CASE", help=f"default: {' '.join(CASES)}")
    args = parser.parse_args()
    unknown = sorted(set(args.names) - set(CASES))
    if unknown:
        parser.error(f"unknown cases {', '.join(unknown)}; allowed: {', '.join(CASES)}")
    for name in args.names or CASES:
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder)
            inputs = CASES[name].arguments(args.shared / "real", out, name)
            _flawforge("diagnose", *inputs, "--out", str(out / "diagnosis"))
            content = (out / "diagnosis" / "diagnosis.json").read_text()
            report = (out / "diagnosis" / "report.html").read_text()
        (HERE / f"{name}.json").write_text(content)
        picture = re.search(rf'alt="{PICTURE}" src="data:image/png;base64,([^"]+)"', report)
        drawn = HERE / f"{name}-residuals.png"
        drawn.unlink(missing_ok=True)
        if picture:
            drawn.write_bytes(base64.b64decode(picture[1]))
        page = PAGE.read_text(encoding="utf-8")
        PAGE.write_text(_filled(page, name, shown(name, json.loads(content), drawn.exists())))


def shown(name: str, found: dict[str, Any], drawn: bool) -> str:
    """Return what the page shows of a diagnosis."""
    before, after = found["heldout"]["before"], found["heldout"]["after"]
    blocks = [
        f"Run of {date.today():%Y-%m-%d} at commit {_commit()}: verdict `{found['verdict']}`, "
        f"probability of no catalogued cause {_percent(found['none_of_these'])}.",
        _effects(found["effects"]),
        _table(
            ("on held-out readings", "nominal", "with the effects"),
            [(w, form.format(before[k]), form.format(after[k])) for w, k, form in FIGURES],
        ),
    ]
    if drawn:
        blocks.append(f"![residuals of {name}, before and after](real/{name}-residuals.png)")
    blocks.append(_residuals(found["left"]))
    ranked = [
        (one["what"], " from ".join(one["between"]), f"{one['expected_log_odds']:.1f}")
        for one in found["next_measurements"][:SCANS]
    ]
    blocks.append(
        _table(("measure next", "separates", "expected change of the log odds"), ranked)
        if ranked else "No scan is proposed."
    )  # fmt: skip
    if found["assumed"]:
        assumed = ", ".join(f"`{key}` {value}" for key, value in found["assumed"].items())
        blocks.append(f"Keys that the sensor's file does not state, as estimated: {assumed}.")
    if found["notes"]:
        blocks.append("Notes of the diagnosis:\n\n" + "\n".join(f"- {n}" for n in found["notes"]))
    return "\n\n".join(blocks)


def _effects(effects: Sequence[dict[str, Any]]) -> str:
    """Lay out names with probabilities, gains and statements."""
    if not effects:
        return "No effect is named."
    lines = []
    for one in effects:
        others = ", ".join(
            f"`{o['name']}` {_percent(o['probability'])}" for o in one["alternatives"]
        )
        lines.append((
            f"`{one['name']}`", _percent(one["probability"]), others or "none",
            f"{one['heldout_gain']:.3f}", one["statement"],
        ))  # fmt: skip
    head = ("effect", "probability", "alternatives", "held-out gain, nats per reading", "statement")
    return _table(head, lines)


def _residuals(left: Sequence[dict[str, Any]]) -> str:
    """Lay out the structure that no effect explains."""
    if not left:
        return "No unexplained residual structure."
    lines = [
        (one["channel"], one["covariate"], one["frame"], f"{one['size']:.2g} {one['unit']}",
         _percent(one["probability"]))
        for one in left
    ]  # fmt: skip
    return _table(("unexplained: channel", "covariate", "frame", "size", "probability"), lines)


def _table(head: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    rows = (head, ["---"] * len(head), *lines)
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def _percent(share: float) -> str:
    """Write a probability; none is certain."""
    if share > 0.99:
        return "> 99 %"
    return "< 1 %" if share < 0.01 else f"{100 * share:.0f} %"


def _filled(page: str, name: str, content: str) -> str:
    """Put what was measured between the page's marks of a case."""
    marks = re.compile(rf"(<!-- measured: {name} -->\n).*?(<!-- end -->)", re.DOTALL)
    if not marks.search(page):
        raise ValueError(f"{PAGE.name}: no marks for '{name}'")
    return marks.sub(lambda found: f"{found[1]}\n{content}\n\n{found[2]}", page)


def _commit() -> str:
    asked = subprocess.run(
        ["git", "log", "-1", "--format=%h", "--", "../../diagnosis", "../../sensors"],
        cwd=HERE,
        check=True,
        capture_output=True,
        text=True,
    )
    return asked.stdout.strip()


def _flawforge(*words: str) -> None:
    subprocess.run([sys.executable, "-m", "flawforge.cli", *words], check=True)


if __name__ == "__main__":
    main()
