"""Blocks of readings that count as independent: their size, sums over them, and intervals."""

import numpy as np

from diagnosis.fields import Field
from diagnosis.noise.noise_model import NoiseModel


def block_of(shape: tuple[int, int], noise: NoiseModel) -> tuple[int, int]:
    """Size (rows, columns) of a block: several correlation lengths, some dozens of blocks."""
    y, x = noise.correlation_length_px()
    rows, columns = shape
    block = (
        int(np.clip(6 * y, 6, max(rows // 6, 2))),
        int(np.clip(6 * x, 6, max(columns // 6, 2))),
    )
    return max(block[0], rows // 16, 1), max(block[1], columns // 16, 1)


def block_sums(field: Field, block: tuple[int, int]) -> Field:
    """Sum over blocks of a grid, (blocks,)."""
    rows = np.add.reduceat(field, np.arange(0, field.shape[0], block[0]), axis=0)
    return np.asarray(np.add.reduceat(rows, np.arange(0, field.shape[1], block[1]), axis=1).ravel())


def bootstrap_interval(
    blocks: Field, rng: np.random.Generator, *, level: float = 0.95, draws: int = 400
) -> tuple[float, float]:
    """Interval of the sum of independent blocks."""
    picks = rng.integers(0, blocks.size, (draws, blocks.size))
    sums = blocks[picks].sum(axis=1)
    low, high = np.quantile(sums, [(1 - level) / 2, (1 + level) / 2])
    return float(low), float(high)
