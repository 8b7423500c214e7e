"""Of several causes the one that all readings need has the name; one that they deny has none."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.diagnose import judge_on_heldout
from diagnosis.explanation import Explanation
from diagnosis.model.model import Model
from diagnosis.physics.laws_at_edges import key_of
from diagnosis.prepare import Prepared
from diagnosis.refuted import without_names
from diagnosis.settings import SETTINGS
from diagnosis.weighed_on_all import _all_seen, _by_laws, weighed_on_all
from sensors.effects.stage_vibration import StageVibration
from sensors.effects.thermal_drift import ThermalDrift
from tests.support.explained import explained
from tests.support.prepared_parts import ready


def test_held_out_readings_give_the_name_to_the_likelier_of_two(
    bent: Prepared, found: Explanation
) -> None:
    assert [c.name for c in found.causes] == ["line_bow"]
    sure, none = weighed_on_all(found, bent, frozenset())
    assert none == []
    assert [(c.name, c.alternatives) for c in sure.causes] == [("line_bow", ())]
    assert sure.model is found.model
    cause = replace(
        found.causes[0], name="form_error", probability=0.5, alternatives=(("line_bow", 0.4),)
    )
    undecided = replace(found, causes=(cause,), model=found.model.without("line_bow"))
    decided, _ = weighed_on_all(undecided, bent, frozenset())
    assert [c.name for c in decided.causes] == ["line_bow"]
    assert decided.model.names() == found.model.names()
    assert decided.causes[0].probability > 0.99


def test_a_name_that_was_not_offered_before_may_be_the_likelier(
    bent: Prepared, found: Explanation, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was named with next to no probability, and an error followed."""
    (member,) = (m for m in found.members if m.candidate.effect == "line_bow")
    odds = {"line_bow": -900.0, "form_error": 5.0, "": -10.0}
    monkeypatch.setattr(
        "diagnosis.weighed_on_all.weighed_again", lambda *_, **__: [replace(member, odds=odds)]
    )
    decided, unlikely = weighed_on_all(found, bent, frozenset())
    assert unlikely == []
    assert [c.name for c in decided.causes] == ["form_error"]
    assert decided.causes[0].probability > 0.99


def test_a_law_that_does_nothing_is_no_rival(bent: Prepared, found: Explanation) -> None:
    """It was the likelier one by its curve, and what had the name stood with next to none."""
    alternatives = (("line_bow", 0.4),)
    cause = replace(
        found.causes[0], name="form_error", probability=0.5, alternatives=alternatives
    )
    for refuted, name in ((frozenset[str](), "line_bow"), (frozenset({"line_bow"}), "form_error")):
        undecided = replace(found, causes=(cause,), model=Model(), refuted=refuted)
        decided, unlikely = weighed_on_all(undecided, bent, frozenset())
        assert unlikely == []
        assert [c.name for c in decided.causes] == [name]


def test_no_two_causes_get_one_name(bent: Prepared, found: Explanation) -> None:
    (bow,) = found.causes
    other = replace(bow, name="form_error", probability=0.5, alternatives=(("line_bow", 0.4),))
    both, _ = weighed_on_all(replace(found, causes=(bow, other)), bent, frozenset())
    assert [c.name for c in both.causes] == ["line_bow", "form_error"]


def test_held_out_readings_speak_against_what_was_there_by_chance(found: Explanation) -> None:
    plain = ready([], 11)
    nothing = explained(plain)
    fooled = replace(
        nothing, causes=found.causes, members=found.members, model=found.model
    )
    left, unlikely = weighed_on_all(fooled, plain, frozenset())
    assert unlikely == ["line_bow"]
    assert left is fooled


def test_what_each_recording_shows_keeps_its_name_where_its_law_is_another(
    bent: Prepared, found: Explanation
) -> None:
    """Of knocks in one recording, a sine says nothing in the next: that refuted the name."""
    assert not weighed_on_all(found, bent, frozenset())[0].causes[0].shown_again
    shaken = ready([{"name": "stage_vibration", "amplitude_um": 5.0, "frequency_hz": 40.0}], 12)
    shown, _ = weighed_on_all(explained(shaken), shaken, frozenset())
    assert [(c.name, c.shown_again) for c in shown.causes] == [("stage_vibration", True)]
    another = StageVibration(amplitude_um=5.0, frequency_hz=25.0)
    misled = replace(shown, model=Model(effects=(another,)))
    judged = judge_on_heldout(shaken, misled, misled.model, shaken.noise, [])
    assert judged.model.is_nominal
    (effect,) = judged.found
    assert effect.name == "stage_vibration"
    assert effect.effect.is_null
    assert effect.probability > 0.9
    assert "the formula is another" in effect.doubt
    assert without_names(misled, shaken).causes[0].name == "stage_vibration"
    of_curves = replace(misled, causes=(replace(misled.causes[0], on_all=False),))
    without = judge_on_heldout(shaken, of_curves, misled.model, shaken.noise, [])
    assert without.found == ()
    assert judged.left == []
    assert [u.component for u in without.left] == [misled.causes[0].component.name]


def test_a_law_at_edges_is_weighed_by_what_it_does_on_all_readings() -> None:
    blurred = ready([{"name": "finite_spot", "line_sd_um": 300.0}], 13, name="steps")
    found = explained(blurred)
    assert [c.name for c in found.causes] == ["finite_spot"]
    law = found.causes[0].component
    assert law is not None
    # good instruments of which a size of this law could tell
    sizes = SETTINGS.mean_sizes()
    weights = np.exp(-0.5 * np.square(np.log(sizes / 0.01)))
    found = replace(
        found, scales={**found.scales, key_of(law, listed=""): weights / weights.sum()}
    )
    sure, unlikely = weighed_on_all(found, blurred, frozenset())
    assert unlikely == []
    (spot,) = sure.causes
    assert spot.on_all
    assert spot.shown_again
    assert not replace(spot, off_edges=True).shown_again
    assert 0.5 < spot.probability <= found.causes[0].probability
    sharp = ready([], 14, name="steps")
    fooled = replace(
        explained(sharp), causes=found.causes, members=found.members, model=found.model,
        scales=found.scales,
    )  # fmt: skip
    assert weighed_on_all(fooled, sharp, frozenset())[1] == ["finite_spot"]
    # what readings off edges show is weighed by its columns there, not by what edges do
    off_edges = replace(found.causes[0], off_edges=True)
    assert _by_laws(replace(fooled, causes=(off_edges,)), sharp) == [off_edges]


@pytest.mark.parametrize(("channel", "left"), [("mean", []), ("scale", ["thermal_drift"])])
def test_a_law_of_no_use_leaves_what_no_other_law_explains(
    bent: Prepared, found: Explanation, channel: str, left: list[str]
) -> None:
    """Beside another law of its channel it was that one's remainder."""
    (bow,) = found.causes
    drift = replace(bow, name="thermal_drift", channel=channel, component=None)
    model = found.model.with_effect(ThermalDrift(amplitude_um=30.0, time_constant_s=0.1))
    both = replace(found, causes=(bow, drift), model=model)
    notes: list[str] = []
    judged = judge_on_heldout(bent, both, model, bent.noise, notes)
    assert [c.name for c in judged.causes] == ["line_bow"]
    assert notes == ["thermal_drift: fitted, but of no use on held-out readings"]
    assert [u.component for u in judged.left] == left


@pytest.mark.parametrize("single", [False, True])
def test_all_readings_are_weighed_in_the_columns_of_baselines(
    bent: Prepared, found: Explanation, single: bool
) -> None:
    """Baselines are looked at once, in the components of the readings that were fitted."""
    every = _all_seen(found.first, replace(bent, single=single))
    assert every.turns is found.first.turns
    assert every.whole.readings > found.first.whole.readings
