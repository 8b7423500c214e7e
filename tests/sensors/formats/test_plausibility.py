"""Doubts at import: marks for missing points, units that can't be."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from files.errors import RecipeError
from sensors.formats.plausibility import check_sizes, sentinels


def surface(seed=0, kind="step"):
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(0, 1, 60), np.linspace(0, 1, 40))
    shape = {
        "step": (x > 0.5) * 1.0, "dome": np.sqrt(np.maximum(0.3 - (x - 0.5) ** 2, 0)),
        "ramp": 3.0 * x, "flat": 0 * x, "two_blocks": 5.0 * (x > 0.3) + 5.0 * (x > 0.7),
    }[kind]  # fmt: skip
    return 20.0 + shape + 0.005 * rng.normal(size=x.shape)


@settings(max_examples=60, deadline=None)
@given(
    mark=st.sampled_from([-32768.0, 65535.0, -99.9999, -10000.0, 0.0, -3.4028234663852886e38, 1e10,
                          -9999.0, 999.999]),
    kind=st.sampled_from(["step", "dome", "ramp", "flat", "two_blocks"]),
    share=st.sampled_from([0.003, 0.05, 0.4]),
    seed=st.integers(0, 4),
)  # fmt: skip
def test_a_mark_is_found_with_its_exact_value(mark, kind, share, seed):
    values = surface(seed, kind)
    gone = np.random.default_rng(seed + 9).uniform(size=values.shape) < share
    gone[0, :3] = True
    values[gone] = mark
    found = sentinels(values)
    assert [one.value for one in found] == [mark]
    assert found[0].count == gone.sum()


@settings(max_examples=60, deadline=None)
@given(
    kind=st.sampled_from(["step", "dome", "ramp", "flat", "two_blocks"]),
    digits=st.integers(2, 6),
    seed=st.integers(0, 20),
)
def test_surfaces_without_a_mark_raise_no_doubt(kind, digits, seed):
    assert sentinels(np.round(surface(seed, kind), digits)) == ()


def test_two_marks_are_named_both():
    values = surface()
    values[:3] = -32768.0
    values[3:5] = 0.0
    assert {one.value for one in sentinels(values)} == {-32768.0, 0.0}


def test_spikes_that_differ_are_no_mark():
    values = surface()
    values[3, :5] = [80.0, 81.5, -20.0, 93.0, 77.7]
    assert sentinels(values) == ()


def test_sizes_in_doubt_stop_without_a_unit_and_are_said_with_one():
    flat = surface(kind="flat") * 1e3
    x, y = np.linspace(0, 12, 60), np.linspace(0, 8, 40)
    bumpy = flat * 1e3
    with pytest.raises(RecipeError, match="states no unit, and in mm heights span"):
        check_sizes(False, bumpy, x, y, True)
    assert "odd: heights span" in check_sizes(True, bumpy, x, y, True)[0]
    with pytest.raises(RecipeError, match="field is 0.012 mm wide"):
        check_sizes(False, surface() * 1e-3, x * 1e-3, y * 1e-3, True)
    assert check_sizes(False, surface(), x, y, True) == ()
