"""What makes an explanation begin again, and what is kept when it does."""

import pytest

from diagnosis.discrepancy.population import population
from diagnosis.explained_again import explained_again
from tests.support.prepared_parts import ready


def test_the_noise_is_measured_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a cause that held-out readings refute, it is as loud as it was found to be."""
    bent = ready([{"name": "line_bow", "sag_um": 40.0}], 11)
    power, unlikely, refuted = [2.0], [["pose_error"], []], []

    def weighed(found, now, withheld):
        refuted.append((found.refuted, now.noise.long_waves))
        return found, unlikely.pop(0)

    monkeypatch.setattr("diagnosis.explained_again.weighed_on_all", weighed)
    monkeypatch.setattr("diagnosis.explained_again.power_of_long_waves", lambda *_: power.pop())
    notes: list[str] = []
    now, found = explained_again(
        bent, population(), frozenset(), notes, lambda _: None, by_all=True
    )
    assert refuted == [(frozenset(), 2.0), (frozenset({"pose_error"}), 2.0)]
    assert now.noise.long_waves == 2.0
    assert [c.name for c in found.causes] == ["line_bow"]
    assert notes[0] == "pose_error: held-out readings speak against it"
    assert sum("2.0 times the power" in note for note in notes) == 1
