"""Candidates of placement: one expectation for judge and maps, the same places for every model."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.data.recorded import Recorded
from diagnosis.localise.maps import expected
from diagnosis.model.model import Model
from diagnosis.register.registration import register
from diagnosis.reregister.reregistration import log_density, registered_under
from diagnosis.validate.heldout import judge
from diagnosis.validate.placement_candidates import Candidates, candidates_of, place_at
from sensors.casting.laser import Laser
from sensors.effects.line_bow import LineBow
from sensors.effects.stage_vibration import StageVibration
from tests.support.effect_case import bench_workspace
from tests.support.small_parts import VIEWS, datasheet, part, record

BOW = LineBow(sag_um=60.0)
WAVE = StageVibration(amplitude_um=25.0, frequency_hz=9.0, phase_rad=1.0)


@pytest.fixture(scope="module")
def candidates() -> Candidates:
    """A recording that was fitted and one held out, with a bow and a wave in both."""
    scene, sheet = part("domes"), datasheet(100)
    laser = Laser.from_datasheet(sheet)
    made = [
        record(scene, sheet, [BOW.to_mapping(), WAVE.to_mapping()], name=f"r{k}", seed=30 + k,
               profiles=60, pitch_mm=0.7, **VIEWS[k])
        for k in range(2)
    ]  # fmt: skip
    recorded = Recorded(
        recordings=tuple(made), scene=scene, datasheet=sheet, laser={r.name: laser for r in made},
        lateral_mm=0.03, held_out=tuple(np.full(r.depth_mm.shape, k == 1) for k, r in
                                        enumerate(made)),
    )  # fmt: skip
    placed = {
        r.name: register(
            scene, r, laser, datasheet=sheet, valid=np.isfinite(r.depth_mm), sd_mm=0.001
        )
        for r in made
    }
    noise = bench_workspace("domes").noise
    patches = [p for k, r in enumerate(made) for p in recorded.cut(k, placed[r.name])]
    found = {
        r.name: registered_under(Model(effects=(BOW,)), p, recorded, noise)
        for r, p in zip(made, patches, strict=True)
    }
    there = [p for k, r in enumerate(made) for p in recorded.cut(k, found[r.name])]
    return candidates_of(recorded, placed, found, (patches, there), noise, share_own=True)


@pytest.mark.parametrize("model", [Model(), Model(effects=(BOW,)), Model(effects=(BOW, WAVE))])
def test_maps_hold_the_expectation_that_was_judged(candidates: Candidates, model: Model) -> None:
    placed = candidates.placed(model)
    judged = judge(placed.held, candidates.noise, placed.model, share_own=True)
    drawn = expected(candidates.recorded, 1, placed, candidates.noise)
    both = np.isfinite(judged.means_mm[0]) & np.isfinite(drawn)
    assert np.array_equal(np.isfinite(judged.means_mm[0]), np.isfinite(drawn))
    assert np.allclose(judged.means_mm[0][both], drawn[both], atol=1e-9)


def test_every_model_has_the_same_candidates_and_takes_the_best(candidates: Candidates) -> None:
    assert all(len(places) == 2 for places in candidates.places)
    for model in (Model(), Model(effects=(BOW,))):
        for number, place in enumerate(candidates.placed(model).places):
            reached = log_density(place.patches, candidates.noise, model)
            for other in candidates.places[number]:
                assert reached >= log_density(other.patches, candidates.noise, model)


def test_a_better_place_serves_the_nominal_model_too(candidates: Candidates) -> None:
    """Where it starts far off, it is found from the other candidate."""
    recorded = candidates.recorded
    near = candidates.places[1][0]
    far = place_at(recorded, 1, near.placement.moved_by(np.array([3.0, 0, 0, 0, 0, 0, 0, 0, 0])))
    alone, both = (
        replace(candidates, places=(candidates.places[0], places))
        for places in ((far,), (far, near))
    )
    reached = [
        log_density(c.placed(Model()).places[1].patches, c.noise, Model()) for c in (alone, both)
    ]
    assert reached[1] >= reached[0]
    assert reached[1] >= log_density(near.patches, candidates.noise, Model())


def test_a_held_out_recording_has_its_own_phase(candidates: Candidates) -> None:
    free = replace(WAVE, phase_rad=None)
    placed = candidates.placed(Model(effects=(BOW, free)))
    assert placed.model.own[1][WAVE.name]["phase_rad"] == pytest.approx(1.0, abs=0.15)
    again = candidates.placed(placed.model)
    assert again.model.own[1] == placed.model.own[1]


def test_all_candidates_are_looked_at_by_the_completed_sensor(candidates: Candidates) -> None:
    """A law that needs what the sensor's file left out is judged from the first placement, too."""
    places = [place for own in candidates.places for place in own]
    nominal = {r.name: own[0].placement for r, own in
               zip(candidates.recorded.recordings, candidates.places, strict=True)}  # fmt: skip
    sheet = replace(candidates.recorded.datasheet, triangulation_angle_deg=20.0, camera_side="-y")
    completed = candidates_of(
        replace(candidates.recorded, datasheet=sheet), nominal, nominal,
        ([p for place in places[::2] for p in place.patches],) * 2,
        candidates.noise, share_own=True,
    )  # fmt: skip
    for own in completed.places:
        assert all(p.view.datasheet is sheet for place in own for p in place.patches)


def test_a_model_is_placed_once(candidates: Candidates) -> None:
    again = Model(effects=(BOW,), own={0: {"stage_vibration": {"phase_rad": 1.0}}})
    assert candidates.placed(again) is candidates.placed(replace(again))
    assert candidates.placed(again) is not candidates.placed(Model(effects=(BOW,)))
