"""What passes for a null."""

from dataclasses import replace

from challenge.cases.nulls import check_null


def test_a_null_stays_within_its_bound(bowed, monkeypatch):
    monkeypatch.setattr("challenge.cases.nulls.NULL_DRAWS", 40)
    secret, staged, _ = bowed
    # the same staged case with the bow departs; without it it does not
    one = replace(secret, recordings=1)
    departed = check_null(staged, one)
    still = check_null(replace(staged, on=staged.off), one)
    assert still.departure < 0.1 < departed.departure
    assert still.lost < 0.005
    assert still.holds
    assert not departed.holds
    assert still.noise_um > 5
    assert 0.05 < still.edge_share < 0.9
    # forty draws leave 0.8 / sqrt(40) = 0.13 of themselves in the mean departure
    assert 0.1 < still.edge_departure < 1.0
