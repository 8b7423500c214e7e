"""Where the recording contradicts the plain simulation: masks, signed strength, regions."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import (
    binary_closing,
    binary_opening,
    find_objects,
    gaussian_filter,
    label,
    uniform_filter,
)

from diagnosis.fields import Field, Mask, Single
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.settings import SETTINGS

MOST_REGIONS = 12
NEIGHBOURS = 5
"""Points a side over which a departure is averaged."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Region:
    """A box of one recording in which it departs, half-open ranges."""

    recording: str
    profiles: tuple[int, int]
    points: tuple[int, int]
    size_um: float
    effect: str

    def below(self, profiles: int) -> "Region":
        """Return the region that many profiles further on."""
        first, end = self.profiles
        return replace(self, profiles=(first + profiles, end + profiles))

    def as_json(self) -> dict[str, object]:
        """Return the region for diagnosis.json."""
        return {
            "recording": self.recording,
            "profiles": list(self.profiles),
            "points": list(self.points),
            "size_um": self.size_um,
            "effect": self.effect,
        }


def smoothed_score(
    residual_mm: Field, sd_mm: Field | Single, noise: NoiseModel, width: float = 2.0
) -> Single:
    """Signed strength: residuals averaged over a few neighbours, in deviations of that average."""
    known = np.isfinite(residual_mm)
    standard = np.where(known, np.clip(np.nan_to_num(residual_mm / sd_mm), -8, 8), 0.0)
    weight = gaussian_filter(known.astype(float), width)
    mean = gaussian_filter(standard, width) / np.maximum(weight, 1e-3)
    # effective readings under the kernel, from the noise's correlation
    inflation = np.sqrt(
        min(max(noise.acf.sum(), 1.0), 4 * np.pi * width**2) / (4 * np.pi * width**2)
    )
    return np.where(known, mean / inflation, 0.0).astype(np.float32)


def departure_mask(
    departure_mm: Field | Single, missing_change: Field | Single, sd_mm: Field | Single
) -> Mask:
    """Where an explained departure, averaged over neighbours, is large against the noise.

    A departure that is small everywhere is marked where it comes near its own peak.
    """
    size = np.abs(uniform_filter(np.nan_to_num(departure_mm / sd_mm), NEIGHBOURS))
    mask = size > SETTINGS.localise.marked_sd
    if not mask.any() and size.any():
        most = float(np.quantile(size[size > 0], 0.98))
        mask = size > max(SETTINGS.localise.faint_share * most, SETTINGS.localise.faint_sd)
    lost = uniform_filter(np.nan_to_num(missing_change), NEIGHBOURS)
    return np.asarray(mask | (np.abs(lost) > SETTINGS.localise.marked_lost))


def free_mask(score: Single, wrong: Mask) -> Mask:
    """Where residuals without explanation stand out, and points whose absence is unexplained."""
    strong = binary_opening(np.abs(score) > SETTINGS.localise.free_score, iterations=1)
    lost = binary_closing(wrong, iterations=2)
    return np.asarray(strong | lost)


def regions_of(
    name: str, mask: Mask, size_um: Field, effect_of: Sequence[tuple[str, Mask]]
) -> list[Region]:
    """Boxes of connected departures, largest first."""
    joined = binary_closing(mask, iterations=2) | mask
    marks, count = label(joined)
    if count == 0:
        return []
    areas = np.bincount(marks.ravel())[1:]
    boxes = find_objects(marks)
    found: list[Region] = []
    for k in np.argsort(areas)[::-1][:MOST_REGIONS]:
        if areas[k] < SETTINGS.localise.least_points and found:
            break
        box = boxes[k]
        here = marks[box] == k + 1
        sizes = np.abs(size_um[box][here])
        sizes = sizes[np.isfinite(sizes)]
        best = max(
            ((int((m[box] & here).sum()), n) for n, m in effect_of), default=(0, "")
        )  # most of the region
        found.append(
            Region(
                recording=name,
                profiles=(box[0].start, box[0].stop),
                points=(box[1].start, box[1].stop),
                size_um=float(np.quantile(sizes, 0.9)) if sizes.size else 0.0,
                effect=best[1] if best[0] else "",
            )
        )
    return found
