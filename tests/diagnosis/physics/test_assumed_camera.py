"""Cameras that a file leaves out are tried at either side; what it states is kept."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from diagnosis.components.component import components_of
from diagnosis.data.recorded import Recorded
from diagnosis.evidence.reported_causes import Cause
from diagnosis.explanation import completed
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.physics.assumed_camera import assumed_sheets, seen_by, with_side
from diagnosis.physics.joint_fit import refit, refit_linear
from diagnosis.physics.laws_at_edges import laws_in_turn
from diagnosis.predict.cameras import with_sheet
from diagnosis.predict.prediction import law_of
from diagnosis.settings import SETTINGS
from sensors.effects.interreflection import Interreflection
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
    sheet = replace(datasheet(60), triangulation_angle_deg=None, camera_side=None)
    tried = assumed_sheets(sheet, [SECOND_LIGHT])
    assert len(tried) == 2 * len(SETTINGS.assumed_angles_deg)
    assert {s.camera_side for s in tried} == {"+y", "-y"}
    assert {s.triangulation_angle_deg for s in tried} == set(SETTINGS.assumed_angles_deg)


def test_a_camera_is_assumed_for_light_from_within_a_part() -> None:
    """Its law is one without a camera, too: where that isn't stated, the file is complete."""
    sheet = replace(datasheet(60), triangulation_angle_deg=None, camera_side=None)
    tried = assumed_sheets(sheet, [replace(SECOND_LIGHT, name="volume_scattering")])
    assert len(tried) == 2 * len(SETTINGS.assumed_angles_deg)
    assert assumed_sheets(sheet, [replace(SECOND_LIGHT, name="incidence_bias")]) == [sheet]


def test_a_side_that_is_stated_is_kept() -> None:
    sheet = replace(datasheet(60), triangulation_angle_deg=None, camera_side="-y")
    tried = assumed_sheets(sheet, [SECOND_LIGHT])
    assert [s.camera_side for s in tried] == ["-y"] * len(SETTINGS.assumed_angles_deg)


def test_a_side_alone_that_is_not_stated_is_tried_at_the_angle_that_is() -> None:
    sheet = replace(datasheet(60), camera_side=None)
    for law in ("interreflection", "finite_spot", "volume_scattering"):
        tried = assumed_sheets(sheet, [replace(SECOND_LIGHT, name=law)])
        assert [(s.triangulation_angle_deg, s.camera_side) for s in tried] == [
            (30.0, "+y"), (30.0, "-y"),
        ]  # fmt: skip


@pytest.fixture(scope="module", params=["+y", "-y"])
def second_light(request: pytest.FixtureRequest) -> tuple[str, Workspace]:
    """A file that states no side of the camera, and light from the wall opposite."""
    seen = bench_workspace("valley")
    states = seen_by(seen.patches, replace(datasheet(seen.patches[0].shape[1]),
                                           camera_side=request.param))  # fmt: skip
    light = Interreflection(weight=0.1, reach_mm=3.0)
    taken = [
        replace(p, depth_mm=p.depth_mm + np.nan_to_num(light.signature(p.view))) for p in states
    ]
    unstated = replace(states[0].view.datasheet, camera_side=None)
    return request.param, replace(seen, patches=tuple(seen_by(taken, unstated)))


def recorded_in(ws: Workspace) -> Recorded:
    view = ws.patches[0].view
    return Recorded(
        recordings=(), scene=view.scene, datasheet=view.datasheet, laser={}, lateral_mm=0.1,
        held_out=(),
    )  # fmt: skip


def test_a_law_at_edges_is_found_whatever_side_the_camera_is_on(
    second_light: tuple[str, Workspace],
) -> None:
    _, ws = second_light
    laws = [c for c in components_of("mean") if c.effect == "interreflection"
            and c.relaxed.spanned]  # fmt: skip
    (found,) = laws_in_turn(laws, ws, Model())
    assert found.fitted is not None
    assert found.gain > 100


def test_the_side_on_which_a_law_suits_the_readings_is_assumed_and_said(
    second_light: tuple[str, Workspace],
) -> None:
    side, ws = second_light
    notes: list[str] = []
    done, patches = completed(
        recorded_in(ws), ws.patches, [SECOND_LIGHT], ws.noise, Model(), notes
    )
    assert done.datasheet == replace(ws.patches[0].view.datasheet, camera_side=side)
    assert patches[0].view.datasheet.camera_side == side
    assert "states no side of the camera" in notes[0]


def test_no_side_is_assumed_that_a_law_does_not_tell(second_light: tuple[str, Workspace]) -> None:
    _, ws = second_light
    notes: list[str] = []
    bow = replace(SECOND_LIGHT, name="line_bow")
    done, patches = completed(recorded_in(ws), ws.patches, [bow], ws.noise, Model(), notes)
    assert done.datasheet.camera_side is None
    assert patches is ws.patches
    assert notes == []


@pytest.mark.parametrize("side", ["+y", "-y"])
def test_listed_shadows_tell_the_side_of_the_camera(side: str) -> None:
    shadows = {"name": "camera_occlusion"}
    there = replace(datasheet(80, [shadows]), camera_side=side)
    unstated = replace(there, camera_side=None)
    taken = []
    for p in bench_workspace("steps").patches:
        seen = np.isfinite(law_of(with_sheet(p.view, there), (), None).mean_mm)
        depth = np.where(seen, p.depth_mm, np.nan)
        taken.append(replace(p, depth_mm=depth, view=with_sheet(p.view, unstated)))
    assert with_side(unstated, taken, []).camera_side == side
    assert with_side(there, taken, []) is there


def test_what_listed_effects_state_of_the_camera_is_taken_from_them() -> None:
    shadows = {"name": "camera_occlusion", "camera_side": "-y", "triangulation_angle_deg": 25.0}
    bare = replace(datasheet(60, [shadows]), camera_side=None, triangulation_angle_deg=None)
    found = with_side(bare, [], [])
    assert (found.camera_side, found.triangulation_angle_deg) == ("-y", 25.0)


def test_patches_are_looked_at_with_another_file(bent: Workspace) -> None:
    other = replace(bent.patches[0].view.datasheet, camera_side="-y")
    patches = seen_by(bent.patches, other)
    assert all(p.view.datasheet is other for p in patches)
    assert patches[0].view.hits is bent.patches[0].view.hits
