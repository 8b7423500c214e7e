"""A bit of the counts that sticks: half of the values never come, although the part has them.

Readings are counts of the sensor's step. Where bit k always has one value, the remainders of the
counts by 2^(k+1) fill one half of their circle and never the other.
"""

from collections.abc import Sequence

import numpy as np

from diagnosis.data.patch import Patch
from diagnosis.evidence.reported_causes import Unexplained
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.settings import SETTINGS
from sensors.effects.relaxed import Relaxed


def stuck_bit(patches: Sequence[Patch], noise: NoiseModel) -> Unexplained | None:
    """Find the highest bit that sticks; None where none does.

    Parameters
    ----------
    noise : in whose deviations the size is given
    """
    step_mm = patches[0].view.datasheet.step_mm
    both = [p.observed & p.counted & p.fit & np.isfinite(p.plain_mm) for p in patches]
    seen, plain = (
        np.rint(
            np.concatenate([v[b] for v, b in zip(values, both, strict=True)]) / step_mm
        ).astype(np.int64)
        for values in ([p.depth_mm for p in patches], [p.plain_mm for p in patches])
    )
    if seen.size < SETTINGS.least_readings:
        return None
    least_values, least_share = SETTINGS.claims.stuck_values, SETTINGS.claims.stuck_share
    for bit in range(int(np.log2(max(np.ptp(seen) / 2, 1))), 0, -1):
        half = 1 << bit
        values = np.unique(seen % (2 * half))
        gaps = np.diff(values, append=values[0] + 2 * half)
        start, width = int(values[gaps.argmax()]), int(gaps.max())
        inside = (plain - start) % (2 * half)
        expected = float(np.mean((inside > width / 4) & (inside < 3 * width / 4)))
        if width >= half and len(values) >= least_values and expected > least_share:
            return Unexplained(
                component=f"bit {bit} of the counts never changes", channel="mean",
                probability=1.0, nats=seen.size * expected,
                size=half * step_mm / 2 / noise.sd_mm,
                relaxed=Relaxed(channel="mean", along=("depth",)),
            )  # fmt: skip
    return None
