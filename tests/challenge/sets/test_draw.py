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


def test_other_makes_get_the_same_faults_with_plates_or_baselines_or_none():
    first, makes = draw(1, FULL), draw(1, FULL, "makes")
    assert [(c.kind, c.switches, c.seed) for c in makes] == [
        (c.kind, c.switches, c.seed) for c in first
    ]
    assert {c.family for c in makes} == {"makes"}
    given = {(c.plates, c.baselines) for c in makes if c.kind == "one"}
    assert given == {(0, 0), (0, 2), (2, 0), (2, 2)}
    # a coarse camera's locking is no change, and a single recording stays single
    bare = [c for c in makes if c.kind == "undecidable" or "pixel_locking" in c.switches]
    assert bare
    assert not any(c.baselines for c in bare)
    with pytest.raises(ValueError, match="allowed: first, second, makes"):
        draw(1, FULL, "third")
