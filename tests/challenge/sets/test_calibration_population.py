"""The opened population: what it holds, and that it is the same every time."""

from challenge.cases.parts import SHAPES
from challenge.cases.switches import SINGLE
from challenge.sets.calibration_population import NULLS, OF_MAKES, planned


def test_nulls_cover_every_part_and_every_switch_is_there_once():
    sets = planned()
    nulls = [s for s in sets.values() if s.kind == "null"]
    assert len(nulls) == NULLS
    assert {s.shape for s in nulls} == set(SHAPES)
    assert sorted(s.switches[0] for s in sets.values() if s.kind == "one") == sorted(SINGLE)


def test_a_set_keeps_its_seed_whatever_else_is_made():
    few, many = planned(nulls=3, each=0), planned()
    assert all(many[name] == secret for name, secret in few.items())
    assert len({s.seed for s in many.values()}) == len(many)


def test_an_effect_lies_on_a_part_that_shows_it():
    for secret in planned().values():
        for name in secret.switches:
            assert not SINGLE[name].shapes or secret.shape in SINGLE[name].shapes


def test_of_other_makes_some_give_plates_and_some_give_baselines():
    sets = planned(population=OF_MAKES)
    given = {(s.plates, s.baselines) for s in sets.values() if s.kind == "null"}
    assert given == {(0, 0), (0, 2), (2, 0), (2, 2)}
    assert not {s.seed for s in sets.values()} & {s.seed for s in planned().values()}
