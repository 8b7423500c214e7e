"""A part in another unit is named with it, before any work; a pose that is off isn't one."""

import numpy as np
import pytest
import trimesh

from diagnosis.register.part_unit import UNITS, unit_hint
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene

LASER = Laser(x_mm=np.linspace(-12.0, 12.0, 97), slope_x=np.zeros(97))


def part(scale=1.0):
    floor = trimesh.creation.box((60.0, 60.0, 10.0))
    block = trimesh.creation.box((20.0, 15.0, 8.0))
    block.apply_translation((3.0, 2.0, 5.0))
    solid = trimesh.boolean.union([floor, block], engine="manifold")
    return Scene(scale * solid.vertices, solid.faces)


def poses(shift_mm=(0.0, 0.0, 0.0)):
    frames = np.tile(np.eye(4), (41, 1, 1))
    frames[:, :3, :3] = np.diag([-1.0, 1.0, -1.0])
    frames[:, 1, 3] = np.linspace(-15.0, 15.0, 41)
    frames[:, 2, 3] = 150.0
    frames[:, :3, 3] += shift_mm
    return frames


def readings():
    noise = 0.05 * np.random.default_rng(1).standard_normal((41, 97))
    return part().cast(LASER, poses()).depth_mm + noise


@pytest.mark.parametrize("factor", UNITS)
@pytest.mark.parametrize("shift_mm", [(0, 0, 0), (1, -1, 1.5)])
def test_each_unit_is_named(factor, shift_mm):
    """Where the readings meet the part as it is, or miss it."""
    given = part(1 / factor), LASER, poses(shift_mm), readings()
    hint = unit_hint(*given) or unit_hint(*given, missed=True)
    option, words = UNITS[factor]
    assert hint == (
        f"doesn't meet the part, which would fit {factor:.4g} times as large: is the part in "
        f"{words}? (try --part-unit {option})"
    )


@pytest.mark.parametrize("shift_mm", [(0, 0, 0), (0, 0, 3), (2, -3, -4), (20, 0, 0), (0, 0, 40)])
def test_a_part_elsewhere_is_in_its_own_unit(shift_mm):
    assert unit_hint(part(), LASER, poses(shift_mm), readings()) is None


@pytest.mark.parametrize("scale", [0.5, 2.0, 5.0])
def test_another_size_is_no_unit(scale):
    assert unit_hint(part(scale), LASER, poses(), readings()) is None
