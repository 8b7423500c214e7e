"""Smooth functions of covariates as columns whose coefficients are alike before any reading.

A function of one covariate is a sum of Legendre polynomials over its range; of several, of their
products. Column j is scaled by (1 + order)^-DECAY, so that independent coefficients of one variance
draw functions whose waves are the smaller the shorter they are (a Karhunen-Loeve form of a smooth
Gaussian process).
"""

import itertools
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from diagnosis.settings import SETTINGS

Floats = NDArray[np.float64]
Ranges = Mapping[str, tuple[float, float]]
"""Range (low, high) over which each covariate's functions are drawn."""


def smooth_columns(
    values: Sequence[Floats], ranges: Sequence[tuple[float, float]], *, even: bool = False
) -> list[Floats]:
    """Columns of a smooth function of one to three covariates.

    Parameters
    ----------
    values : (n, m) each, or (n, 1) or (m,); NaN counts as the middle
    ranges : of each covariate
    even : whether the function is even in the first, about the middle of its range

    Returns
    -------
    columns, (n, m) when broadcast, without the constant
    """
    orders = SETTINGS.orders(len(values))
    powers = []
    for value, (low, high), order in zip(values, ranges, orders, strict=True):
        u = np.clip(2 * (np.nan_to_num(value, nan=0.5 * (low + high)) - low) / (high - low) - 1,
                    -1, 1)  # fmt: skip
        powers.append(np.moveaxis(legendre.legvander(u, order), -1, 0))
    columns = []
    for picked in products(len(values), even=even):
        column = np.full((), (1.0 + sum(picked)) ** -SETTINGS.decay)
        for k, own in zip(picked, powers, strict=True):
            column = column * own[k]
        columns.append(column)
    return columns


def products(dimensions: int, *, even: bool = False) -> list[tuple[int, ...]]:
    """Orders of the polynomials whose products are the columns of a smooth function."""
    orders = SETTINGS.orders(dimensions)
    return [
        picked
        for picked in itertools.product(*(range(order + 1) for order in orders))
        if 0 < sum(picked) <= max(orders) and not (even and picked[0] % 2)
    ]


def total_orders(dimensions: int, *, even: bool = False) -> NDArray[np.int64]:
    """Total order of each column of a smooth function."""
    return np.array([sum(p) for p in products(dimensions, even=even)])


def periodic_columns(phase: Floats, harmonics: int) -> list[Floats]:
    """Sines and cosines of a phase in turns, with harmonics that fall as their order."""
    out = []
    for k in range(1, harmonics + 1):
        out += [f(2 * np.pi * k * phase) / k for f in (np.sin, np.cos)]
    return out
