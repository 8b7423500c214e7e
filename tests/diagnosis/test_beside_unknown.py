"""Names beside unknown physics of their channel are as probable as a second mechanism."""

from dataclasses import replace

import pytest

from diagnosis.beside_unknown import doubted_causes, doubted_claims, share_held
from diagnosis.claims.filtered import Filtered
from diagnosis.evidence.reported_causes import Unexplained
from diagnosis.explanation import Explanation
from diagnosis.prepare import Prepared
from diagnosis.settings import SETTINGS
from diagnosis.validate.found_effects import plainly_found
from sensors.effects.line_bow import LineBow
from sensors.effects.onboard_filter import OnboardFilter
from sensors.effects.roughness_level import RoughnessLevel

SECOND = SETTINGS.second_mechanism


def left(channel: str, probability: float) -> Unexplained:
    return Unexplained(
        component="what nobody knows", channel=channel, probability=probability, nats=20.0,
        size=1.0,
    )  # fmt: skip


def test_a_name_holds_where_nothing_is_left_or_as_a_second_mechanism() -> None:
    assert share_held([], ["mean"]) == 1.0
    assert share_held([left("scale", 1.0)], ["mean"]) == 1.0
    assert share_held([left("mean", 1.0)], ["mean"]) == pytest.approx(SECOND)
    # 0.6 of a mechanism and 0.5 of another: none with 0.2
    two = [left("mean", 0.6), left("mean", 0.5)]
    assert share_held(two, ["mean"]) == pytest.approx(0.2 + 0.8 * SECOND)
    assert share_held([left("scale", 0.6)], ["variance"]) == pytest.approx(0.4 + 0.6 * SECOND)
    assert share_held([left("outliers", 1.0)], ["tails"]) == pytest.approx(SECOND)


def test_a_filter_is_unknown_physics_where_its_law_says_nothing() -> None:
    median = OnboardFilter.none().with_parameters(median_points=3, median_profiles=3)
    mean = OnboardFilter.none().with_parameters(mean_points=3)
    known = [Filtered(effect=effect, probability=0.9, unknown=0.0) for effect in (median, mean)]
    assert [share_held([], ["mean"], one) for one in known] == [1.0, 1.0]
    # on slopes a median leaves more noise
    on_noise = [share_held([], ["variance"], one) for one in known]
    assert on_noise == pytest.approx([0.1 + 0.9 * SECOND, 1.0])
    other = replace(known[1], unknown=0.5)
    for channel in ("mean", "variance", "missing", "tails"):
        assert share_held([], [channel], other) == pytest.approx(0.55 + 0.45 * SECOND)
    assert share_held([left("mean", 0.6)], ["mean"], other) == pytest.approx(
        0.22 + 0.78 * SECOND
    )


def test_a_cause_beside_sure_unknown_physics_loses_its_name(
    bent: Prepared, found: Explanation
) -> None:
    beside = replace(found, unexplained=(left("mean", 0.999),))
    notes: list[str] = []
    doubted = doubted_causes(beside, bent, notes)
    assert [note.partition(":")[0] for note in notes] == [c.name for c in found.causes]
    assert doubted.causes == ()
    assert doubted.model.is_nominal
    # what it was found by is left
    assert [u.component for u in doubted.unexplained] == [
        *(c.unnamed().component for c in found.causes), "what nobody knows",
    ]  # fmt: skip


def test_a_cause_beside_unsure_unknown_physics_is_less_probable(
    bent: Prepared, found: Explanation
) -> None:
    beside = replace(found, unexplained=(left("mean", 0.55),))
    (before,), (after,) = found.causes, doubted_causes(beside, bent, []).causes
    share = 0.45 + 0.55 * SECOND
    assert after.probability == pytest.approx(share * before.probability)
    assert 1 - after.none_of_these == pytest.approx(share * (1 - before.none_of_these))
    other = replace(found, unexplained=(left("scale", 1.0),))
    assert [c.name for c in doubted_causes(other, bent, []).causes] == ["line_bow"]


def test_what_was_found_against_claims_is_doubted_alike() -> None:
    bow = plainly_found(LineBow(sag_um=40.0), 1.0, {}, probability=0.9)
    rough = plainly_found(RoughnessLevel(amplitude=2.0), 1.0, {}, probability=0.9)
    assert [f.name for f in doubted_claims([bow, rough], [left("scale", 1.0)])] == ["line_bow"]
    (kept,) = doubted_claims([rough], [left("scale", 0.5)])
    assert kept.probability == pytest.approx(0.9 * (0.5 + 0.5 * SECOND))
