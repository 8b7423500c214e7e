"""A relief of known shape, as a bank would hold it."""

import numpy as np

from defects.flaw_bank import FlawBank, Relief


def hollow_and_rim(depth_mm: float = 0.2, pitch_mm: float = 0.1) -> FlawBank:
    """Return a bank of one: an uneven hollow 4 by 2.4 mm with a rim a tenth as high."""
    x, y = np.meshgrid(np.arange(-33, 34), np.arange(-23, 24), indexing="ij")
    angle = np.arctan2(y / 12, x / 20)
    rho = np.hypot(x / 20, y / 12) / (1 + 0.1 * np.cos(3 * angle + 1))
    height = np.where(rho < 1, -depth_mm * (1 - rho**2), 0.0)
    rim = np.clip((rho - 1) / 0.25, 0, 1)
    height += np.where(rho >= 1, 0.4 * depth_mm * rim * (1 - rim), 0.0)
    mask = rho < 1.2
    return FlawBank(
        reliefs=(Relief(name="hollow", pitch_mm=pitch_mm, height_mm=height, mask=mask),)
    )
