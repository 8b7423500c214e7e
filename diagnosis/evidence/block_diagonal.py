"""Block-diagonal matrices without their zeros: what each recording has of its own."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from diagnosis.fields import Single

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class BlockDiagonal:
    """Blocks (k_i, l_i) along the diagonal of a matrix (sum of k_i, sum of l_i)."""

    parts: Sequence[Floats | Single]

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return sum(p.shape[0] for p in self.parts), sum(p.shape[1] for p in self.parts)

    @property
    def T(self) -> "BlockDiagonal":
        """The transpose."""
        return BlockDiagonal([p.T for p in self.parts])

    def __matmul__(self, rows: Floats) -> Floats:
        """Multiply rows (sum of l_i, ...)."""
        own, first = [], 0
        for part in self.parts[:-1]:
            own.append(part @ rows[first : first + part.shape[1]])
            first += part.shape[1]
        own.append(self.parts[-1] @ rows[first:])
        return own[0] if len(own) == 1 else np.concatenate(own)

    def dense(self) -> Floats:
        """Return the matrix with its zeros."""
        return self @ np.eye(self.shape[1])
