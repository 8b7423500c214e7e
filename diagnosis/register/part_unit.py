"""Whether the part is in another unit: as it is it is elsewhere, scaled by a unit it fits."""

import math

import numpy as np

from diagnosis.fields import Field
from diagnosis.settings import SETTINGS
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene

UNITS = {
    1000.0: ("m", "m"), 25.4: ("inch", "inch"), 10.0: ("cm", "cm"), 0.1: ("mm", "mm, not cm"),
    1 / 25.4: ("mm", "mm, not inch"), 0.001: ("um", "um, or mm, not m"),
}  # fmt: skip
"""Option and words for each factor on a part whose unit was taken for mm, or for its own."""


def unit_hint(
    scene: Scene, rays: Laser, poses: Field, depth: Field, *, missed: bool = False
) -> str | None:
    """Name the unit in which the part fits readings (n, m), mm, from commanded poses.

    None where it fits as it is, or in no unit.

    Parameters
    ----------
    missed : whether the readings miss the part as it is
    """
    need, fit_mm = SETTINGS.register.unit_met, SETTINGS.register.position_mm
    off, met = _misfit(scene, rays, poses, depth)
    if not missed and (met < need or off < fit_mm):
        return None
    near_mm = 3 * fit_mm if missed else min(fit_mm, SETTINGS.register.unit_nearer * off)
    fits = []
    for factor in UNITS:
        scaled = Scene(scene.vertices_mm * factor, scene.faces)
        distance, share = _misfit(scaled, rays, poses, depth)
        if share >= need and distance < near_mm:
            fits.append((distance, factor))
    if not fits:
        return None
    _, factor = min(fits)
    option, words = UNITS[factor]
    return (
        f"doesn't meet the part, which would fit {factor:.4g} times as large: is the part in "
        f"{words}? (try --part-unit {option})"
    )


def _misfit(scene: Scene, rays: Laser, poses: Field, depth: Field) -> tuple[float, float]:
    """Median distance along the rays, mm, and the share of the readings that meet the part."""
    away = np.abs(scene.cast(rays, poses).depth_mm - depth)
    away = away[np.isfinite(away)]
    share = away.size / max(int(np.isfinite(depth).sum()), 1)
    return (float(np.median(away)) if away.size else math.inf), share
