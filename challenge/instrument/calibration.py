"""Calibration: from the chip's row to depth, learnt from a noisy scan of a target.

The instrument does not know its own lens. It looks at a plate at several heights that a
(not quite perfect) gauge states, and fits the reciprocal of depth as a polynomial of row and
column, or a polynomial of its own for every column. Bow, scale and column errors are what
such a calibration leaves.
"""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True, slots=True)
class CalibrationPlan:
    """How the maker calibrates.

    Attributes
    ----------
    heights, frames
        Number of target heights, and frames (with the target moved between them) at each.
    row_degree, column_degree
        Degrees of the polynomial; a column degree of -1 gives every column its own.
    gauge_mm
        Standard deviation of the stated heights.
    gauge_stretch
        Relative error of the gauge's scale (a warm gauge states too little).
    plate_bow_mm
        Sag of the target plate over the half width of the line; taken for flat.
    """

    heights: int = 17
    frames: int = 8
    row_degree: int = 4
    column_degree: int = 4
    gauge_mm: float = 0.0003
    gauge_stretch: float = 0.0
    plate_bow_mm: float = 0.0


@dataclass(frozen=True, kw_only=True, slots=True)
class Calibration:
    """Coefficients of 1/z over row and column.

    Attributes
    ----------
    shared : (r, c) or None
        Chebyshev coefficients over row and column.
    own : (r, columns) or None
        Chebyshev coefficients of every column.
    rows
        Rows of the chip, which scale the argument.
    """

    shared: NDArray[np.float64] | None
    own: NDArray[np.float64] | None
    rows: int

    def depth_mm(self, row: NDArray[np.float64]) -> NDArray[np.float64]:
        """Depth for rows (n, columns); NaN stays NaN."""
        u = row / (self.rows / 2) - 1
        if self.own is not None:
            return 1 / chebyshev.chebval(u, self.own[:, None, :], tensor=False)
        assert self.shared is not None
        v = np.broadcast_to(np.linspace(-1, 1, row.shape[1]), row.shape)
        return 1 / chebyshev.chebval2d(u, v, self.shared)


def fit(
    row: NDArray[np.float64], depth_mm: NDArray[np.float64], rows: int, plan: CalibrationPlan
) -> Calibration:
    """Fit the calibration to rows seen of a target at stated depths.

    Parameters
    ----------
    row : (n, columns)
        Peak rows, NaN where none was found.
    depth_mm : (n,)
        Stated depth of the target in each frame.
    rows
        Rows of the chip.

    Returns
    -------
    Calibration
    """
    columns = row.shape[1]
    u = row / (rows / 2) - 1
    target = np.broadcast_to(1 / depth_mm[:, None], row.shape)
    seen = np.isfinite(row)
    if plan.column_degree < 0:
        own = np.empty((plan.row_degree + 1, columns))
        for c in range(columns):
            own[:, c] = chebyshev.chebfit(u[seen[:, c], c], target[seen[:, c], c], plan.row_degree)
        return Calibration(shared=None, own=own, rows=rows)
    v = np.broadcast_to(np.linspace(-1, 1, columns), row.shape)
    design = chebyshev.chebvander2d(u[seen], v[seen], [plan.row_degree, plan.column_degree])
    solved = np.asarray(np.linalg.lstsq(design, target[seen], rcond=None)[0], np.float64)
    shape = (plan.row_degree + 1, plan.column_degree + 1)
    return Calibration(shared=solved.reshape(shape), own=None, rows=rows)
