"""Blocks along a diagonal multiply as the matrix with its zeros."""

import numpy as np
import pytest
from scipy.linalg import block_diag

from diagnosis.evidence.block_diagonal import BlockDiagonal
from diagnosis.evidence.posterior import Cavity

RNG = np.random.default_rng(0)
PARTS = [RNG.standard_normal((3, 2)), RNG.standard_normal((4, 1))]
DENSE = block_diag(*PARTS)
BLOCKS = BlockDiagonal(PARTS)


def test_it_is_the_matrix_with_its_zeros() -> None:
    assert BLOCKS.shape == DENSE.shape
    assert BLOCKS.dense() == pytest.approx(DENSE)
    assert BLOCKS.T.dense() == pytest.approx(DENSE.T)


@pytest.mark.parametrize("shape", [(7,), (7, 5)])
def test_it_multiplies_as_that_does(shape: tuple[int, ...]) -> None:
    rows = RNG.standard_normal(shape)
    assert BLOCKS.T @ rows == pytest.approx(DENSE.T @ rows)


def test_rows_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ValueError, match="matmul"):
        BLOCKS @ np.zeros(4)


def test_the_information_on_combinations_is_the_same() -> None:
    root = RNG.standard_normal((9, 7))
    cavity = Cavity(information=root.T @ root, pull=RNG.standard_normal(7))
    blocks, dense = cavity.combined(BLOCKS), cavity.combined(DENSE)
    assert blocks.information == pytest.approx(dense.information)
    assert dense.information == pytest.approx(DENSE.T @ root.T @ root @ DENSE)
    assert blocks.pull == pytest.approx(dense.pull)
