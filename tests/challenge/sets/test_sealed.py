"""Seals: what a set draws, and that a commitment binds."""

import pytest

from challenge.cases.case import Secret
from challenge.cases.switches import SINGLE
from challenge.sets.sealed import FULL, commitment, counts_of, draw, seal


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


def test_commitment_binds():
    secret = Secret(kind="null", switches=(), strength=1, shape="waves", recordings=3, seed=4)
    key, nonce, digest = seal(secret, {"noise_um": 3.0})
    assert commitment(nonce, key) == digest
    assert commitment(nonce, key.replace(b"waves", b"bosse")) != digest
    assert seal(secret, {"noise_um": 3.0})[2] != digest  # another nonce hides equal keys
