"""Laws of light at edges beside baselines, whatever the sensor's file leaves out."""

from dataclasses import replace

from diagnosis.explain_laws import Good
from diagnosis.model.model import Model
from sensors.effects.interreflection import Interreflection
from tests.support.prepared_parts import ready


def test_baselines_are_seen_by_the_camera_that_was_assumed() -> None:
    """A law that needs the camera's angle is weighed in baselines, too."""
    one = ready([], 11, name="valley")
    unstated = replace(one.recorded.datasheet, triangulation_angle_deg=None)
    bare = Good(noise=one.noise, scales={}, departures={}, baseline=one.patches).seen_by(unstated)
    assert bare is not None
    good = Good(noise=one.noise, scales={}, departures={}, baseline=bare.patches)
    seen = good.seen_by(replace(unstated, triangulation_angle_deg=30.0))
    assert seen is not None
    light = Model().with_effect(Interreflection(weight=0.2))
    assert seen.most_probable(light) < seen.most_probable(Model())
    assert Good(noise=one.noise, scales={}, departures={}, baseline=()).seen_by(unstated) is None
