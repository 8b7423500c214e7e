"""A commitment binds its key."""

from challenge.cases.case import Secret
from challenge.sets.sealed import commitment, seal


def test_commitment_binds():
    secret = Secret(kind="null", switches=(), strength=1, shape="waves", recordings=3, seed=4)
    key, nonce, digest = seal(secret, {"noise_um": 3.0})
    assert commitment(nonce, key) == digest
    assert commitment(nonce, key.replace(b"waves", b"bosse")) != digest
    assert seal(secret, {"noise_um": 3.0})[2] != digest  # another nonce hides equal keys
