"""Measure how many scans that are aimed at a flaw hold its centre: every preset, five seeds.

Run `python docs/datasets/measure_aim.py` from the top of the checkout.
"""

from functools import cache

import numpy as np

from files.yaml_document import parse_text
from pipeline.injection.flawed_part import FlawedPart
from pipeline.injection.flawplan import FlawPlan
from pipeline.injection.inject import inject
from pipeline.motion.aim import Aimer, Outlook
from pipeline.motion.limits import Motion
from pipeline.parts import builtin
from pipeline.seeds import streams
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet, preset_names

PARTS = ("bearing_cap", "car_door", "steel_plate")
SEEDS = (1, 2, 3, 4, 5)
SCANS, PROFILES, POINTS = 20, 240, 512
FLAWS = FlawPlan.from_mapping({"dent": 2, "crack": 1, "pit": 2, "scratch": 1, "bump": 1})
MOTION = """\
length_mm: {uniform: [60, 120]}
standoff_mm: {uniform: [-10, 10]}
roll_deg: {uniform: [-5, 5]}
pitch_deg: {uniform: [-5, 5]}
yaw_deg: {uniform: [-30, 30]}
direction: {choice: [-1, 1]}
aim_at_flaws: 1
"""


def motion() -> Motion:
    """Return the limits of the documented recipe, every scan aimed."""
    from pydantic import TypeAdapter

    return TypeAdapter(Motion).validate_python(parse_text(MOTION, where="motion"))


@cache
def specimen(name: str, seed: int) -> tuple[FlawedPart, Scene]:
    """Return a flawed part and its clean scene; flaws sit where the nominal look sees them."""
    part = builtin.build(name)
    scene = Scene(part.vertices_mm, part.faces)
    outlook = Outlook(part, scene, motion(), Datasheet.load("KEYENCE-LJ-X8200"), PROFILES)
    flawed = inject(
        part, FLAWS, visible_faces=outlook.facing, visible_at=outlook.free,
        rng_of=streams(seed, name, 0, "flaws"),
    )  # fmt: skip
    return flawed, scene


def held(preset: str, name: str, seed: int) -> tuple[int, int, int]:
    """Return aimed scans, those that hold the flaw meant, and paths drawn for them."""
    flawed, scene = specimen(name, seed)
    sheet = Datasheet.load(preset)
    aimer = Aimer(
        flawed=flawed,
        outlook=Outlook(flawed.part, scene, motion(), sheet, PROFILES),
        scene=scene,
        motion=motion(),
        datasheet=sheet,
        laser=Laser.from_datasheet(sheet, points=POINTS),
        profiles=PROFILES,
    )
    hits = paths = 0
    for number in range(SCANS):
        path, drawn = aimer.path(streams(seed, name, 0, "scan", number))
        hits += aimer.holds(path, int(path.facts["aimed_at_instance"]))
        paths += drawn
    return SCANS, hits, paths


def table() -> list[str]:
    """Return the measured table, Markdown."""
    lines = [
        "| sensor | line, mm | aimed scans | hold the flaw's centre | worst seed | paths drawn |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for preset in preset_names("presets"):
        counts = np.array([[held(preset, name, seed) for name in PARTS] for seed in SEEDS])
        by_seed = counts.sum(axis=1)
        aimed, hits, paths = by_seed.sum(axis=0)
        worst = (by_seed[:, 1] / by_seed[:, 0]).min()
        lines.append(
            f"| {preset} | {Datasheet.load(preset).x_fov_mm:g} | {aimed} | {hits / aimed:.1%} |"
            f" {worst:.1%} | {paths / aimed:.2f} a scan |"
        )
    return lines


if __name__ == "__main__":
    print("\n".join(table()))
