"""Columns of smooth functions: even where asked, as many as counted, smaller the shorter."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from diagnosis.components.smooth import periodic_columns, products, smooth_columns
from diagnosis.settings import SETTINGS

X = np.linspace(-3.0, 3.0, 41)
Y = np.linspace(0.0, 5.0, 33)


@pytest.mark.parametrize("even", [True, False])
def test_there_are_as_many_columns_as_products(even: bool) -> None:
    one = smooth_columns([X], [(-3.0, 3.0)], even=even)
    assert len(one) == len(products(1, even=even))
    two = smooth_columns([X[None], Y[:, None]], [(-3.0, 3.0), (0.0, 5.0)], even=even)
    assert len(two) == len(products(2, even=even))
    assert {np.broadcast_shapes(c.shape, (33, 41)) for c in two} == {(33, 41)}


def test_even_functions_are_even_about_the_middle() -> None:
    for column in smooth_columns([X], [(-3.0, 3.0)], even=True):
        assert np.allclose(column, column[::-1])
    odd = [c for c in smooth_columns([X], [(-3.0, 3.0)]) if not np.allclose(c, c[::-1])]
    assert len(odd) == len(products(1)) - len(products(1, even=True))


def test_shorter_waves_are_smaller() -> None:
    """The largest value of a Legendre polynomial is 1, at an end."""
    sizes = [np.abs(c).max() for c in smooth_columns([X], [(-3.0, 3.0)])]
    assert sizes == pytest.approx([(1.0 + sum(p)) ** -SETTINGS.decay for p in products(1)])
    assert sizes == sorted(sizes, reverse=True)


def test_what_is_not_known_counts_as_the_middle() -> None:
    for column in smooth_columns([np.array([np.nan, 0.0])], [(-3.0, 3.0)]):
        assert column[0] == column[1]


@given(harmonics=st.integers(1, 6), start=st.floats(-2, 2))
def test_periodic_columns_repeat_after_a_turn(harmonics: int, start: float) -> None:
    columns = periodic_columns(start + np.linspace(0, 1, 17), harmonics)
    assert len(columns) == 2 * harmonics
    for k, column in enumerate(columns):
        assert column[0] == pytest.approx(column[-1], abs=1e-9)
        assert np.abs(column).max() <= 1 / (k // 2 + 1) + 1e-12
