"""Aim: a scan aimed at a flaw holds its centre, however wide the line and short the path."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.injection.flawplan import FlawPlan
from pipeline.injection.inject import inject
from pipeline.motion.aim import Aimer, Outlook
from pipeline.motion.limits import Motion
from pipeline.motion.trajectory import sweeps
from pipeline.parts import builtin
from pipeline.seeds import streams
from quantity.distribution import Fixed, Uniform
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet, preset_names

PROFILES, POINTS, PATHS = 60, 64, 40


@pytest.fixture(scope="module")
def specimen():
    part = builtin.build("steel_plate", None, length_mm=400.0, width_mm=300.0)
    scene = Scene(part.vertices_mm, part.faces)
    plan = FlawPlan.from_mapping({"pit": 2, "dent": {"number": 2, "length_mm": 6}})
    up = scene.normals[:, 2] > 0.9
    flawed = inject(part, plan, visible_faces=up, rng_of=streams(3, "flaws"))
    assert len(flawed.flaws) == 4
    return flawed, scene


def aimer(specimen, sheet, **limits):
    flawed, scene = specimen
    motion = Motion(
        length_mm=Uniform(low=60, high=120), yaw_deg=Uniform(low=-30, high=30), aim_at_flaws=1.0,
        **limits,
    )  # fmt: skip
    return Aimer(
        flawed=flawed,
        outlook=Outlook(flawed.part, scene, motion, sheet, PROFILES),
        scene=scene,
        motion=motion,
        datasheet=sheet,
        laser=Laser.from_datasheet(sheet, points=POINTS),
        profiles=PROFILES,
    )


@pytest.mark.parametrize("preset", preset_names("presets"))
def test_an_aimed_scan_sweeps_the_flaw_meant(specimen, preset):
    sheet = Datasheet.load(preset)
    one = aimer(specimen, sheet, roll_deg=Uniform(low=-5, high=5))
    centres = {flaw.instance: flaw.position_mm for flaw in one.flawed.flaws}
    held, offsets = [], []
    for number in range(PATHS):
        path, _ = one.path(streams(1, number))
        centre = centres[path.facts["aimed_at_instance"]][None]
        held.append(sweeps(path.poses, centre, sheet)[0])
        crossing = np.einsum("ij,ij->i", centre - path.poses[:, :3, 3], path.poses[:, :3, 1])
        offsets.append(np.argmin(np.abs(crossing)) / (PROFILES - 1) - 0.5)
    assert np.mean(held) >= 0.95
    assert np.std(offsets) > 0.1  # the flaw isn't always in the middle of the path


def test_a_line_much_wider_than_the_path_does_not_carry_the_aim_off_the_path(specimen):
    wide = Datasheet.load("AT-C5-4090CS30-495")  # 495 mm; the paths are 60 to 120 mm long
    first = []
    for number in range(PATHS):
        path, drawn = aimer(specimen, wide).path(streams(2, number))
        first.append(drawn)
        flaw = specimen[0].flaws[path.facts["aimed_at_instance"] - 1]
        assert sweeps(path.poses, flaw.position_mm[None], wide)[0]
    assert np.mean(np.array(first) == 1) > 0.9  # by the bound, not by drawing again


def test_a_flaw_in_the_shade_is_not_held(specimen):
    one = aimer(specimen, Datasheet.load("KEYENCE-LJ-X8200"), standoff_mm=Fixed(value=0.0))
    path, _ = one.path(streams(1, 0))
    instance = path.facts["aimed_at_instance"]
    assert one.holds(path, instance)
    floor_mm = one.flawed.part.bounds_mm[0, 2]
    turned = [
        replace(flaw, position_mm=np.array([*flaw.position_mm[:2], floor_mm]), normal=-flaw.normal)
        for flaw in one.flawed.flaws
    ]  # the same places, on the back
    one.flawed = replace(one.flawed, flaws=tuple(turned))
    assert not one.holds(path, instance)
