"""Cameras that a file leaves out are tried at either side; what it states is kept."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from diagnosis.evidence.reported_causes import Cause
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.physics.assumed_camera import assumed_sheets, seen_by
from diagnosis.physics.joint_fit import refit, refit_linear
from diagnosis.settings import SETTINGS
from sensors.effects.line_bow import LineBow
from sensors.effects.range_scale import RangeScale
from tests.support.effect_case import bench_workspace, taken_with
from tests.support.small_parts import datasheet

SECOND_LIGHT = Cause(
    name="interreflection", channel="mean", probability=0.9, alternatives=(),
    none_of_these=0.1, nats=50.0,
)  # fmt: skip


@pytest.fixture(scope="module")
def bent() -> Workspace:
    return taken_with(bench_workspace("domes"), "domes", LineBow(sag_um=40.0))


@pytest.mark.parametrize("again", [refit_linear, refit])
def test_effects_are_refitted_beside_each_other(
    bent: Workspace, again: Callable[[Workspace, Model], Model]
) -> None:
    off = Model(effects=(LineBow(sag_um=25.0), RangeScale(error_ppm=300.0)))
    found = again(bent, off)
    bow = next(e for e in found.effects if isinstance(e, LineBow))
    assert bow.sag_um == pytest.approx(40.0, abs=3.0)


def test_a_file_that_states_its_camera_stays_as_it_is() -> None:
    sheet = datasheet(60)
    assert assumed_sheets(sheet, [SECOND_LIGHT]) == [sheet]
    bare = replace(sheet, triangulation_angle_deg=None)
    assert assumed_sheets(bare, []) == [bare]


def test_a_camera_that_is_not_stated_is_tried_at_either_side() -> None:
    sheet = replace(datasheet(60), triangulation_angle_deg=None)
    tried = assumed_sheets(sheet, [SECOND_LIGHT])
    assert len(tried) == 2 * len(SETTINGS.assumed_angles_deg)
    assert {s.camera_side for s in tried} == {"+y", "-y"}
    assert {s.triangulation_angle_deg for s in tried} == set(SETTINGS.assumed_angles_deg)


def test_a_side_that_is_stated_is_kept() -> None:
    sheet = replace(datasheet(60), triangulation_angle_deg=None, camera_side="-y")
    tried = assumed_sheets(sheet, [SECOND_LIGHT])
    assert [s.camera_side for s in tried] == ["-y"] * len(SETTINGS.assumed_angles_deg)


def test_patches_are_looked_at_with_another_file(bent: Workspace) -> None:
    other = replace(bent.patches[0].view.datasheet, camera_side="-y")
    patches = seen_by(bent.patches, other)
    assert all(p.view.datasheet is other for p in patches)
    assert patches[0].view.hits is bent.patches[0].view.hits
