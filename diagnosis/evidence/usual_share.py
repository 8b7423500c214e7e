"""By how much what good instruments have moves the strength of a law that is fitted."""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from diagnosis.evidence.candidates import Candidate
from diagnosis.evidence.mean_causes import Member, Scales

Floats = NDArray[np.float64]
Places = NDArray[np.int64]


def usual_share(
    member: Member, matrix: Floats, candidates: Sequence[Candidate], departures: Scales
) -> float:
    """Return the relative deviation of a law's strength by what good instruments have.

    Parameters
    ----------
    member : the law's cause, with its most probable coefficients
    matrix : of the equations that these are of
    departures : probabilities of each component's sizes in a good instrument
    """
    others = [
        (c.at, departures.rms(c.key))
        for c in candidates
        if c.shapes[0] is None and not c.component.placement
    ]
    return moved_by(matrix, member.candidate.at, member.coefficients, others)


def moved_by(
    matrix: Floats, at: Places, coefficients: Floats, others: Iterable[tuple[Places, float]]
) -> float:
    r"""Relative standard deviation of a strength θ beside departures X_k b_k, b_k ~ N(0, s_k²).

    Least squares take X_o c θ for all of y = X_o c + X_k b_k + ε, so that

        sd(θ) = max_k s_k |G_ko c| / (c' G_oo c)

    The components overlap, and what one of them shows of a departure others show as well: the one
    that moves the strength most counts (a systematic error of an instrument that is known by the
    spread of its kind: GUM, JCGM 100:2008, 4.3).

    Parameters
    ----------
    matrix : G (M, M)
    at, coefficients : columns of the law's component, and c
    others : columns of each other component, and s_k
    """
    pulled = matrix[:, at] @ coefficients
    energy = float(coefficients @ pulled[at])
    if energy <= 0:
        return 0.0
    return max((s * float(np.linalg.norm(pulled[k])) for k, s in others), default=0.0) / energy
