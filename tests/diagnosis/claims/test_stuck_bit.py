"""A bit that sticks leaves half of the values out; coarse steps and few levels don't."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.claims.stuck_bit import stuck_bit
from diagnosis.data.patch import Patch
from diagnosis.prepare import Prepared
from tests.support.prepared_parts import ready


@pytest.fixture(scope="module")
def good() -> Prepared:
    return ready([], 3)


def counted(p: Patch) -> np.ndarray:
    step = p.view.datasheet.step_mm
    return np.nan_to_num(np.rint(p.depth_mm / step)).astype(np.int64)


def delivered(good: Prepared, counts_of) -> list[Patch]:
    return [
        replace(p, depth_mm=np.where(p.observed, counts_of(counted(p)) * p.view.datasheet.step_mm,
                                     np.nan))
        for p in good.patches
    ]  # fmt: skip


@pytest.mark.parametrize("bit", [6, 9])
@pytest.mark.parametrize("value", [0, 1])
def test_a_stuck_bit_is_told_by_its_number(good: Prepared, bit: int, value: int) -> None:
    """Counted from anywhere: where count 0 lies no file says."""
    which = 1 << bit

    def stick(counts: np.ndarray) -> np.ndarray:
        moved = counts + 777
        return (moved | which if value else moved & ~which) - 777

    found = stuck_bit(delivered(good, stick), good.noise)
    assert found is not None
    assert found.component == f"bit {bit} of the counts never changes"
    step = good.patches[0].view.datasheet.step_mm
    assert found.size * good.noise.sd_mm == pytest.approx(which * step / 2)


@pytest.mark.parametrize("coarse", [1, 2, 4, 7, 64])
def test_plain_counts_and_coarse_ones_have_none(good: Prepared, coarse: int) -> None:
    patches = delivered(good, lambda counts: counts // coarse * coarse)
    assert stuck_bit(patches, good.noise) is None


def test_a_part_of_two_levels_leaves_values_out_by_itself(good: Prepared) -> None:
    """No value is missing that the part would give."""
    flat = [
        replace(p, plain_mm=level, depth_mm=level + p.depth_mm - p.plain_mm)
        for p in good.patches
        for level in [np.where(p.plain_mm > np.nanmedian(p.plain_mm), 60.0, 60.4)]
    ]
    assert stuck_bit(flat, good.noise) is None
