"""A declared number: bounds, their text, and the message for a value out of bounds."""

import math
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from defects.kinds import KINDS
from pipeline.parts.builtin import NAMES, describe
from quantity import Quantity, quantities, quantity
from quantity.distribution import Uniform
from sensors.effects import CATALOGUE

BOUND = st.floats(-1e6, 1e6)


@given(BOUND, BOUND, st.floats(allow_nan=True), st.booleans(), st.booleans())
def test_a_number_is_held_between_its_bounds(one, other, value, above, below):
    low, high = sorted((one, other))
    known = Quantity(low=low, high=high, above=above, below=below)
    inside = (low < value if above else low <= value) and (value < high if below else value <= high)
    assert known.holds(value) == inside
    assert known.holds(np.float64(value)) == inside


@pytest.mark.parametrize("value", [True, "1", None, (1.0,)])
def test_only_numbers_are_held(value):
    assert not Quantity(low=0.0, high=2.0).holds(value)


@pytest.mark.parametrize(
    ("known", "words"),
    [
        (Quantity(low=0.2, high=200.0, unit="mm"), "0.2 to 200 mm"),
        (Quantity(low=0.0, above=True, unit="Hz"), "above 0 Hz"),
        (Quantity(low=2), "at least 2"),
        (Quantity(low=1, high=1_000_000), "1 to 1000000"),
        (Quantity(low=0.0, high=90.0, above=True, below=True, unit="°"), "above 0 and below 90 °"),
        (Quantity(), "any number"),
    ],
)
def test_bounds_in_words(known, words):
    assert known.allowed == words


def test_every_number_of_a_value_is_checked():
    share = Quantity(low=0.0, high=1.0)
    for value in (None, 0.5, (0.0, 1.0), {"a": 0.2, "b": (0.1, 0.3)}, Uniform(low=0.1, high=0.2)):
        assert share.check(value) is value
    with pytest.raises(ValueError, match="^0 to 1$"):
        share.check(2.0)
    with pytest.raises(ValueError, match=r"^b\.1: got 1\.3; allowed: 0 to 1$"):
        share.check({"a": 0.2, "b": (0.1, 1.3)})
    with pytest.raises(ValueError, match="^0 to 1$"):
        share.check(Uniform(low=0.5, high=1.5))


def test_declarations_are_read_from_the_class():
    @dataclass(frozen=True, kw_only=True, slots=True)
    class Lamp:
        name: str = "lamp"
        power_w: float = quantity("power of the lamp", unit="W", low=0.0, high=5.0, default=1.0)
        count: int = quantity("number of lamps", low=1, whole=True)

    power, count = quantities(Lamp)
    assert (power.name, power.unit, power.default, power.meaning) == (
        "power_w", "W", 1.0, "power of the lamp"
    )  # fmt: skip
    assert (count.name, count.default, count.whole) == ("count", None, True)
    assert Lamp(count=2).power_w == 1.0
    with pytest.raises(TypeError, match="count"):
        Lamp()


def test_flaws_parts_and_effects_say_all_of_their_numbers():
    unit_of = {"mm": "_mm", "µm": "_um", "°": "_deg", "rad": "_rad", "ms": "_ms", "Hz": "_hz"}
    sets = [kind.sizes() for kind in KINDS.values()]
    sets += [describe(name) for name in NAMES]
    sets += [effect.parameters() for effect in CATALOGUE.values()]
    for known in (size for one in sets for size in one):
        assert known.meaning, known.name
        assert known.name.endswith(unit_of.get(known.unit, "")), known
        assert known.low <= known.high
        assert math.isfinite(known.low)
        assert math.isfinite(known.high)
