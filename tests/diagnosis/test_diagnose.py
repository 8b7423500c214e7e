"""The whole diagnosis on small simulated recordings: silence, explanation, honest ignorance."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from diagnosis.diagnose import gained, outweighed
from diagnosis.diagnosis import Diagnosis
from diagnosis.evidence.reported_causes import Cause
from diagnosis.explanation import fitted_part
from diagnosis.model.model import Model
from diagnosis.prepare import Inputs, prepared
from files.errors import RecipeError
from sensors.effects.line_bow import LineBow
from sensors.recording import Recording
from tests.support.diagnosis_of import diagnosis_of
from tests.support.small_parts import VIEWS, datasheet, part, record


def recordings(
    name: str, effects: Sequence[dict[str, object]], *, seed: int = 1, views: int = 3
) -> list[Recording]:
    return [
        record(part(name), datasheet(100), effects, name=f"r{k}", seed=10 * seed + k, profiles=72,
               pitch_mm=0.6, **view)
        for k, view in enumerate(VIEWS[:views])
    ]  # fmt: skip


def run(name: str, made: Sequence[Recording], withheld: Iterable[str] = ()) -> Diagnosis:
    return diagnosis_of(made, part(name), datasheet(100), withheld=withheld)


@pytest.mark.parametrize(("name", "seed"), [("domes", 1), ("steps", 2), ("bowl", 3)])
def test_nothing_missing_is_a_match(name: str, seed: int) -> None:
    result = run(name, recordings(name, [], seed=seed))
    assert result.verdict == "match"
    assert result.effects == ()
    assert result.share_of_points == 0
    assert result.regions == ()
    low, high = 0.86, 0.94
    assert low < result.before.coverage[1] < high


def test_a_bow_is_named_measured_and_located() -> None:
    result = run("domes", recordings("domes", [{"name": "line_bow", "sag_um": 30.0}]))
    assert result.verdict == "explained"
    assert [e.name for e in result.effects] == ["line_bow"]
    sag = result.effects[0].parameters["sag_um"]
    assert sag.low is not None
    assert sag.high is not None
    assert sag.low < 30.0 < sag.high
    assert sag.value == pytest.approx(30.0, rel=0.1)
    assert result.effects[0].frame == "sensor"
    assert result.after.log_score < result.before.log_score
    assert result.after.rms_um < result.before.rms_um
    # a placement takes up the bow's mean: ends and middle depart, what lies between crosses zero
    mask = result.maps[0].mask
    assert mask[:, :8].mean() > 0.9
    assert mask[:, 20:24].mean() < 0.2


def test_shadows_are_told_by_the_camera_side() -> None:
    result = run("steps", recordings("steps", [{"name": "camera_occlusion"}]))
    assert result.effects[0].name == "camera_occlusion"
    assert result.effects[0].effect.camera_side in (None, "+y")  # type: ignore[attr-defined]
    angle = result.effects[0].parameters["triangulation_angle_deg"]
    assert angle.value == pytest.approx(30.0, abs=3.0)
    assert result.after.brier < 0.5 * result.before.brier


def test_an_effect_outside_the_catalogue_is_not_given_a_synonym() -> None:
    made = recordings("domes", [{"name": "pixel_locking", "amplitude_px": 0.2}])
    result = run("domes", made, withheld=("pixel_locking",))
    assert result.verdict in ("unexplained", "partly_explained")
    assert [r.channel for r in result.left if r.period is not None] == ["mean"]
    rippled = next(r for r in result.left if r.period is not None)
    assert rippled.unit == rippled.period_unit == "µm"
    assert rippled.size > 1.0


@pytest.mark.slow
def test_held_out_recordings_are_never_fitted() -> None:
    made = recordings("domes", [{"name": "line_bow", "sag_um": 30.0}])
    spoiled = replace(made[2], depth_mm=made[2].depth_mm + 0.2 * np.sin(np.arange(100) / 3.0))
    one, two = run("domes", made), run("domes", [*made[:2], spoiled])
    assert one.effects[0].effect == two.effects[0].effect
    assert two.after.rms_um > 3 * one.after.rms_um


def test_input_that_cannot_be_used_is_named() -> None:
    made = recordings("bowl", [], views=2)
    with pytest.raises(RecipeError, match="same name"):
        run("bowl", [made[0], made[0]])
    with pytest.raises(RecipeError, match="in metres"):
        run("bowl", [replace(made[0], depth_mm=made[0].depth_mm / 1000)])
    with pytest.raises(RecipeError, match="out of its range"):
        run("bowl", [replace(made[0], depth_mm=made[0].depth_mm + 300)])


def test_what_laws_gain_is_how_much_more_probable_they_make_the_fitted_readings() -> None:
    made, scene = recordings("domes", [{"name": "line_bow", "sag_um": 30.0}]), part("domes")
    inputs = Inputs(
        recordings=made, vertices_mm=scene.vertices_mm, faces=scene.faces, datasheet=datasheet(100)
    )
    ready = prepared(inputs, [], lambda _: None)
    ws = fitted_part(ready.patches, ready.noise)

    def nats(sag_um: float) -> float:
        return gained(ws, Model().with_effect(LineBow(sag_um=sag_um)), Model())

    assert nats(0.0) == 0.0
    # quadratic about the truth: half of it gains three quarters
    assert nats(15.0) == pytest.approx(0.75 * nats(30.0), rel=0.1)


def test_what_held_out_readings_say_against_laws_is_weighed_with_what_speaks_for_them() -> None:
    sure = Cause(
        name="incidence_bias", channel="mean", probability=0.95, alternatives=(),
        none_of_these=0.05, nats=6.0,
    )  # fmt: skip
    unsure = replace(sure, probability=0.6, none_of_these=0.4)
    assert outweighed(20.0, 21.0, [sure])
    assert not outweighed(20.0, 19.0, [sure])
    assert not outweighed(0.0, 2.9, [sure])  # nats; odds of 19 are 2.94
    assert outweighed(0.0, 3.0, [sure])
    assert outweighed(0.0, 1.0, [sure, unsure])
    assert not outweighed(-5.0, -1.0, [unsure])
