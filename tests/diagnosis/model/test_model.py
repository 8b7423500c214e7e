"""Models: parameters of recordings stay with their effect."""



from diagnosis.model.model import Model
from sensors.effects.line_bow import LineBow
from sensors.effects.stage_vibration import StageVibration

WAVE = StageVibration(amplitude_um=8.0, frequency_hz=7.0, phase_rad=0.3)


def test_an_effect_takes_the_place_of_one_of_its_name() -> None:
    model = Model(effects=(LineBow(sag_um=1.0),)).with_effect(LineBow(sag_um=2.0))
    assert model.effects == (LineBow(sag_um=2.0),)
    both = model.with_effect(WAVE, {0: {"phase_rad": 1.0}, 1: {"phase_rad": 2.0}})
    assert both.names() == ("line_bow", "stage_vibration")
    phases = [both.of(r)[1].to_mapping()["phase_rad"] for r in (0, 1, 2)]
    assert phases == [1.0, 2.0, 0.3]
    assert both.without("stage_vibration").of(0) == model.effects
    assert both.with_effect(WAVE).of(1) == (*model.effects, WAVE)  # its own phases are gone
