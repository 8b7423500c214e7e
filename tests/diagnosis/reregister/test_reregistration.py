"""Recordings are placed anew under a model, held-out ones too; drifts, levels, strong effects."""

from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest

from diagnosis.data.patch import cut
from diagnosis.data.recorded import Recorded
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.physics.effect_fit import fit_effect
from diagnosis.register.placement import PRIOR_SD, Placement
from diagnosis.reregister.reregistration import reregistered
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet
from sensors.effects.base import Effect
from sensors.effects.interreflection import Interreflection
from sensors.effects.line_bow import LineBow
from sensors.recording import Recording
from sensors.view.view import View
from tests.support.effect_case import bench_workspace, taken_with
from tests.support.small_parts import datasheet, part, record

FAINT = Model(effects=(LineBow(sag_um=0.01),))
"""All but nominal."""


def begun(view: View, start_time_s: float) -> View:
    """Return a view of a recording that began then."""
    return View(
        view.scene, view.sensor, view.poses, view.time_s, laser=view.laser,
        start_time_s=start_time_s,
    )  # fmt: skip


@pytest.fixture(scope="module")
def ws() -> Workspace:
    return bench_workspace("valley")


def as_commanded(
    misplaced: float,
) -> tuple[Scene, Datasheet, Laser, Recording, Placement]:
    """Return part, sensor, rays, a recording of the part misplaced, and where it is told."""
    scene, sheet = part("domes"), datasheet(100)
    made = record(
        scene, sheet, [], name="r", seed=4, profiles=70, pitch_mm=0.6, misplaced=misplaced
    )
    commanded = Placement(
        shift=np.zeros(PRIOR_SD.size), centre_mm=np.zeros(3),
        covariance=np.eye(PRIOR_SD.size), poses=made.poses,
    )  # fmt: skip
    return scene, sheet, Laser.from_datasheet(sheet), made, commanded


def alone(
    made: Recording, scene: Scene, sheet: Datasheet, laser: Laser, *, held_out: bool
) -> Recorded:
    """Return one recording under study."""
    return Recorded(
        recordings=(made,), scene=scene, datasheet=sheet, laser={made.name: laser},
        lateral_mm=0.03, held_out=(np.full(made.depth_mm.shape, held_out),),
    )  # fmt: skip


def test_a_held_out_recording_is_placed_anew(ws: Workspace) -> None:
    scene, sheet, laser, made, commanded = as_commanded(6.0)
    patches = cut(
        0, made, commanded, scene, sheet, laser, lateral_mm=0.03,
        held_out=np.ones(made.depth_mm.shape, dtype=bool),
    )  # fmt: skip
    assert not any(p.fit.any() for p in patches)
    recorded = alone(made, scene, sheet, laser, held_out=True)
    found, placed = reregistered(FAINT, patches, recorded, {"r": commanded}, ws.noise)
    off = [
        np.nanmedian(np.abs(made.depth_mm - scene.cast(laser, poses).depth_mm))
        for poses in (made.poses, placed["r"].poses)
    ]
    assert off[1] < 0.01 < off[0]
    assert all(p.scored.any() for p in found)


class Elsewhere(Recorded):
    """Recordings whose registration ends 3 mm aside of where they are told to lie."""

    asked: ClassVar[list[int]] = []

    def register(self, number: int, *_: object) -> Placement:
        """Return another optimum than the best."""
        self.asked.append(number)
        poses = self.recordings[number].poses.copy()
        poses[:, 0, 3] += 3.0
        return Placement(
            shift=np.zeros(PRIOR_SD.size), centre_mm=np.zeros(3),
            covariance=np.eye(PRIOR_SD.size), poses=poses,
        )  # fmt: skip


def test_a_recording_stays_where_its_readings_are_more_probable(ws: Workspace) -> None:
    """A registration under a model may end in another optimum."""
    scene, sheet, laser, made, commanded = as_commanded(6.0)
    patches = cut(0, made, commanded, scene, sheet, laser, lateral_mm=0.03)
    recorded = Elsewhere(
        recordings=(made,), scene=scene, datasheet=sheet, laser={made.name: laser},
        lateral_mm=0.03, held_out=(np.zeros(made.depth_mm.shape, dtype=bool),),
    )  # fmt: skip
    found, placed = reregistered(FAINT, patches, recorded, {"r": commanded}, ws.noise)
    assert recorded.asked == [0]
    assert found == patches
    assert placed["r"] is commanded


class OneElsewhere(Elsewhere):
    """Recordings of which the second's registration ends aside, the first's where it lies."""

    asked: ClassVar[list[int]] = []

    def register(self, number: int, *of: object) -> Placement:
        """Return the best placement of the first."""
        aside = super().register(number, *of)
        return aside if number else replace(aside, poses=self.recordings[0].poses)


def test_what_lies_well_under_a_model_is_not_placed_again(ws: Workspace) -> None:
    scene, sheet, laser, made, commanded = as_commanded(0.0)
    off = commanded.poses.copy()
    off[:, 2, 3] += 0.2
    both = (made, replace(made, name="s"))
    recorded = OneElsewhere(
        recordings=both, scene=scene, datasheet=sheet, laser=dict.fromkeys("rs", laser),
        lateral_mm=0.03, held_out=(np.zeros(made.depth_mm.shape, dtype=bool),) * 2,
    )  # fmt: skip
    placed = {"r": replace(commanded, poses=off), "s": commanded}
    patches = [p for k, r in enumerate(both) for p in recorded.cut(k, placed[r.name])]
    model = Model(effects=(LineBow(sag_um=300.0),))
    found, where = reregistered(model, patches, recorded, placed, ws.noise)
    assert recorded.asked == [0, 1]
    assert found[1] is patches[1]
    assert where["r"].poses is made.poses
    assert where["s"] is commanded


def test_a_strong_reflection_is_fitted_beyond_what_is_linear(ws: Workspace) -> None:
    true = Interreflection(weight=0.6, reach_mm=8.0, power=1.0)
    there, model = taken_with(ws, "valley", true), Model()
    predictions = there.predict(model)
    base, masks = there.log_densities(model), there.masks_for(Interreflection)

    def gain(effect: Effect) -> float:
        after = there.log_densities(there.levelled(model.with_effect(effect)))
        gains = [a - b for a, b in zip(after, base, strict=True)]
        return float(there.block_scores(gains, masks).sum())

    quick, found = (
        fit_effect(
            Interreflection, there, model, there.states(predictions), polish=polish
        )
        for polish in (False, True)
    )
    assert quick is not None
    assert found is not None
    # readings that scatter so much count as spikes to first order; the law knows better
    assert quick.gain > 0.3 * gain(true)
    assert found.gain > 0.98 * gain(true)
