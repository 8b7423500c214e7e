"""Named streams of random numbers."""

from challenge.cases.seeds import child


def test_named_streams_are_independent():
    first = child(5, "a").random(4)
    assert (child(5, "a").random(4) == first).all()
    assert (child(5, "b").random(4) != first).all()
    assert (child(6, "a").random(4) != first).all()
