"""What a scan of each kind of flaw costs beside a dent's: CPU time, ratios within one run.

Run `python -m benchmarks.flaw_kinds --write docs/flaws/cost.md`. A scan here is all that a dataset
needs for one: a specimen with one flaw of typical sizes drawn and cut, its scene, one path, one
scan of 400 by 1024 readings with its labels. Kinds and dents take turns on the same part, so that
a busy machine slows both.
"""

import argparse
import time
from pathlib import Path
from statistics import median

import numpy as np

from defects.flaw_bank import FlawBank, Relief
from defects.kinds import KINDS
from defects.kinds.banked import Banked
from defects.surface.surface import Surface as Skin
from pipeline.injection.flawplan import FlawPlan, exactly
from pipeline.injection.inject import inject
from pipeline.motion.trajectory import Trajectory, frame
from pipeline.parts import builtin
from pipeline.parts.part import Part
from pipeline.scan.labelled_scan import Conditions, take_scan
from pipeline.seeds import streams
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet
from sensors.model import SensorModel
from sensors.surface.surface import Surface

PARTS = {
    "undercut": "welded_plate", "lack_of_fusion": "welded_plate", "porosity": "welded_plate",
    "edge_chip": "welded_plate", "edge_burr": "welded_plate", "wear": "welded_plate",
    "missing_feature": "bearing_cap",
}  # fmt: skip
PROFILES, POINTS, PITCH_MM = 400, 1024, 0.1
MOST = 2.0
"""Ratio that no kind may exceed."""


def bank() -> FlawBank:
    """Return a bank of one uneven hollow, 4 by 2.4 mm, of 40 by 24 nodes: a usual extraction."""
    x, y = np.meshgrid(np.arange(-33, 34), np.arange(-23, 24), indexing="ij")
    rho = np.hypot(x / 20, y / 12) / (1 + 0.1 * np.cos(3 * np.arctan2(y / 12, x / 20) + 1))
    rim = np.clip((rho - 1) / 0.25, 0, 1)
    height = np.where(rho < 1, -0.2 * (1 - rho**2), 0.08 * rim * (1 - rim))
    return FlawBank(
        reliefs=(Relief(name="hollow", pitch_mm=PITCH_MM, height_mm=height, mask=rho < 1.2),)
    )


class Stage:
    """A part with what scans of it share."""

    def __init__(self, name: str) -> None:
        self.part: Part = builtin.build(name)
        self.skin = Skin.of(self.part.vertices_mm, self.part.faces)
        self.clean = Scene(self.part.vertices_mm, self.part.faces)
        self.up = self.skin.normals[:, 2] > 0.3
        self.sensor = SensorModel(Datasheet.load("AT-C5-4090CS30-495"))
        self.laser = Laser.from_datasheet(self.sensor.datasheet, points=POINTS)
        self.surface = Surface.load("car_door").ready(
            PITCH_MM, PITCH_MM, z_resolution_um=4.0, repeatability_um=1.0
        )

    def seconds(self, kind: str, seed: int) -> float:
        """Return the CPU time of one specimen and one scan; infinite where no place was found."""
        start = time.process_time()
        rng_of = streams(seed, "cost", kind)
        plan = exactly(kind, bank=bank() if kind == Banked.name else None)
        flawed = inject(
            self.part, FlawPlan(kinds=(plan,)), visible_faces=self.up, surface=self.skin,
            rng_of=rng_of,
        )  # fmt: skip
        if not flawed.flaws:
            return np.inf
        at = flawed.flaws[0].position_mm
        poses = np.tile(np.eye(4), (PROFILES, 1, 1))
        poses[:, :3, :3] = frame((0, 0, -1), (0, 1, 0))
        way = PITCH_MM * (np.arange(PROFILES) - PROFILES / 2)
        working = self.sensor.datasheet.working_distance_mm
        poses[:, :3, 3] = at + np.outer(way, [0, 1, 0]) + [0, 0, working]
        path = Trajectory(poses=poses, time_s=np.arange(PROFILES) / 500.0, facts={})
        scenes = (Scene(flawed.vertices_mm, flawed.faces), self.clean)
        conditions = Conditions(
            sensor=self.sensor, laser=self.laser, surface=self.surface, visible_at=3.0
        )
        take_scan(flawed, scenes, path, conditions, rng_of)
        return time.process_time() - start


def measure(kinds: list[str], seeds: int) -> dict[str, tuple[float, float, float]]:
    """Return of each kind its median ratio to a dent, the ratio of the means, its median in ms."""
    stages: dict[str, Stage] = {}
    found = {}
    for kind in kinds:
        name = PARTS.get(kind, "steel_plate")
        stage = stages.setdefault(name, Stage(name))
        stage.seconds(kind, 999)  # compiles and loads
        stage.seconds("dent", 999)
        pairs = [(stage.seconds(kind, k), stage.seconds("dent", k)) for k in range(seeds)]
        own, dent = np.array([pair for pair in pairs if np.isfinite(pair).all()]).T
        found[kind] = (
            median(own) / median(dent), float(own.mean() / dent.mean()), 1e3 * median(own)
        )  # fmt: skip
        print(f"{kind:<16} {found[kind][0]:5.2f} {found[kind][1]:5.2f} {found[kind][2]:7.0f} ms",
              flush=True)  # fmt: skip
    return found


def table(found: dict[str, tuple[float, float, float]], seeds: int) -> str:
    """Return the table as Markdown."""
    lines = [
        f"CPU time of a specimen and its scan over a dent's on the same part, {seeds} of each,",
        "one run of `python -m benchmarks.flaw_kinds`:", "",
        "| kind | part | median | mean |", "| --- | --- | --- | --- |",
    ]  # fmt: skip
    lines += [
        f"| {kind} | {PARTS.get(kind, 'steel_plate')} | {middle:.2f} | {mean:.2f} |"
        for kind, (middle, mean, _) in found.items()
    ]
    return "\n".join(lines) + "\n"


def main() -> int:
    """Measure, print and, if wanted, write; 1 where a kind costs more than it may."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kinds", nargs="*", help="kinds to measure; all where none is named")
    parser.add_argument("--seeds", type=int, default=15, help="specimens of each kind")
    parser.add_argument("--write", type=Path, metavar="FILE.md", help="write the table")
    wanted = parser.parse_args()
    found = measure(wanted.kinds or list(KINDS), wanted.seeds)
    if wanted.write:
        wanted.write.write_text(table(found, wanted.seeds), encoding="utf-8")
    return int(any(middle > MOST for middle, _, _ in found.values()))


if __name__ == "__main__":
    raise SystemExit(main())
