"""Laws of light at edges beside baselines, whatever the sensor's file leaves out."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from diagnosis.evidence.reported_causes import Cause
from diagnosis.explain_laws import AtEdges, Good, by_law_at_edges
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


@pytest.mark.parametrize(
    ("off_edges", "rivals"), [(True, ["motion_blur", "finite_spot"]), (False, ["finite_spot"])]
)
def test_off_edges_every_law_is_a_rival(
    monkeypatch: pytest.MonkeyPatch, off_edges: bool, rivals: list[str]
) -> None:
    """How much of a law good instruments have at edges tells nothing of it elsewhere."""

    class Compared(Exception):
        pass

    def among_laws(cause, others, *_, **__):
        raise Compared([law.effect for law in others])

    monkeypatch.setattr("diagnosis.explain_laws.among_laws", among_laws)
    monkeypatch.setattr("diagnosis.explain_laws._completed", lambda state, *_: state)
    monkeypatch.setattr("diagnosis.explain_laws.fitted_part", lambda *_: None)
    blur, spot = (SimpleNamespace(effect=name) for name in ("motion_blur", "finite_spot"))
    cause = Cause(
        name="finite_spot", channel="mean", probability=0.9, alternatives=(), none_of_these=0.1,
        nats=9.0, off_edges=off_edges,
    )  # fmt: skip
    usual = {"motion_blur", *(["finite_spot"] if off_edges else [])}
    state = SimpleNamespace(refuted=frozenset(), patches=(), model=None, fitted_here=dict)
    good = SimpleNamespace(noise=None)
    with pytest.raises(Compared) as compared:
        by_law_at_edges(state, None, AtEdges(laws=(blur, spot), usual=usual), cause, good, [])
    assert compared.value.args == (rivals,)
