"""What a diagnosis costs: seconds and memory at the sizes that it is meant for.

`python -m benchmarks.diagnosis_cost` measures, and fills the table of docs/diagnosis.md.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import trimesh

from benchmarks.end_to_end import HOME
from benchmarks.page import fill
from benchmarks.page_datasets import table
from sensors.noise.perlin import PerlinField
from tests.support.small_parts import VIEWS, datasheet, part, record

PAGE = HOME / "docs" / "diagnosis.md"
LENGTH_MM = 44.0
SPECKLE_READINGS = 2.5
"""Cell of the noise over the pitch: a sensor's speckle is about as fine as its readings."""
MISSING = ({"name": "line_bow", "sag_um": 40.0},)
SIZES = ((3, 240, 400, 15.0, 1.0), (1, 2000, 4096, 60.0, 4.0))
"""Recordings, profiles, points; seconds of one core and GiB of memory that they may take."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Cost:
    """What one diagnosis took, and what it said."""

    wall_s: float
    processor_s: float
    peak_bytes: int
    said: str


def write_case(folder: Path, count: int, profiles: int, points: int) -> list[str]:
    """Write recordings of the domes by a line that is bowed; return the command's arguments."""
    scene, sheet = part("domes"), datasheet(points)
    speckle = PerlinField(
        amplitude_mm=0.035, octaves=3,
        cell_x_mm=SPECKLE_READINGS * LENGTH_MM / points,
        cell_y_mm=SPECKLE_READINGS * LENGTH_MM / profiles,
    )  # fmt: skip
    names = []
    for k, placing in enumerate(VIEWS[:count]):
        names.append(f"{'abc'[k]}.h5")
        record(
            scene, sheet, MISSING, name="abc"[k], seed=k, profiles=profiles,
            pitch_mm=LENGTH_MM / profiles, speckle=speckle, **placing,
        ).save(folder / names[-1])  # fmt: skip
    trimesh.Trimesh(scene.vertices_mm, scene.faces, process=False).export(folder / "part.stl")
    sheet.save(folder / "sensor.yaml")
    return [*names, "--part", "part.stl", "--sensor", "sensor.yaml", "--out", "diagnosis"]


def measure(folder: Path, arguments: list[str]) -> Cost:
    """Run the command in a folder."""
    begin = time.perf_counter()
    command = [sys.executable, "-m", "flawforge.cli", "diagnose", *arguments, "--quiet"]
    with subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL) as process:
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"the diagnosis ended with {process.returncode}")
    answer = json.loads((folder / "diagnosis" / "diagnosis.json").read_text())
    names = ", ".join(e["name"] for e in answer["effects"])
    return Cost(
        wall_s=time.perf_counter() - begin,
        processor_s=used.ru_utime + used.ru_stime,
        peak_bytes=1024 * used.ru_maxrss,
        said=f"{answer['verdict']}: {names or 'nothing'}",
    )


def main() -> None:
    """Measure each size and fill the page."""
    lines = []
    for count, profiles, points, aim_s, aim_gib in SIZES:
        with tempfile.TemporaryDirectory() as name:
            cost = measure(Path(name), write_case(Path(name), count, profiles, points))
        lines.append(
            (
                f"{count} of {profiles} × {points}", cost.said, f"{cost.wall_s:.0f} s",
                f"{cost.processor_s:.0f} s", f"{aim_s:.0f} s",
                f"{cost.peak_bytes / 2**30:.2f} GiB", f"{aim_gib:.0f} GiB",
            )
        )  # fmt: skip
        print(*lines[-1], flush=True)
    head = ("recordings", "found", "clock", "processor", "aim", "peak memory", "aim")
    PAGE.write_text(fill(PAGE.read_text(), {"cost": table(head, lines)}))


if __name__ == "__main__":
    main()
