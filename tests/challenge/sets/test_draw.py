"""A set holds every kind of case, in an order of its own."""

import pytest

from challenge.cases.imitation import IMITATES
from challenge.cases.switches import SINGLE
from challenge.sets.draw import FULL, counts_of, draw


def test_a_set_has_all_kinds_and_no_order():
    cases = draw(1, FULL)
    assert len(cases) == 160
    assert [c.kind for c in cases[:20]] != ["null"] * 20
    assert {s for c in cases if c.kind == "one" for s in c.switches} == set(SINGLE)
    assert len({c.seed for c in cases}) == 160
    assert draw(1, FULL) == cases
    assert draw(2, FULL) != cases
    assert len(draw(1, counts_of(24))) == 24
    with pytest.raises(ValueError, match="12 or more"):
        counts_of(11)


def test_of_undecidable_cases_a_stranger_gets_one_aligned_recording_and_no_plate():
    cases = [c for c in draw(1, FULL) if c.kind == "undecidable"]
    assert {c.switches[0] for c in cases} == set(IMITATES)
    assert all(c.aligned and c.recordings == 1 and not c.plates and c.strength for c in cases)
    assert not any(c.aligned for c in draw(1, FULL) if c.kind != "undecidable")
