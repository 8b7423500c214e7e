"""The noise of the recordings, and the noise that plates or the surface's file claim."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from diagnosis.noise.noise_model import NoiseModel, calibrate
from diagnosis.predict.albedo_borders import albedo_borders
from diagnosis.predict.prediction import plain_gain
from diagnosis.settings import SETTINGS
from sensors.effects.delivery import DeliveryEffect
from sensors.law import geometric_law
from sensors.noise.uncertainty import sigma_mm
from sensors.surface.surface import Surface
from sensors.view.view import View

if TYPE_CHECKING:
    from diagnosis.data.patch import Patch
    from diagnosis.data.plates import Plate


def calibrated_noise(
    patches: Sequence["Patch"],
    plates: Sequence["Plate"],
    notes: list[str],
) -> tuple[NoiseModel, NoiseModel | None]:
    """Correlation and size from the recordings' own residuals, losses and tails from plates.

    Residuals count where the nominal mean is sure: off depth edges and off borders of the albedo.
    """
    fields, masks = [], []
    for patch in patches:
        mask = (
            patch.fit & patch.observed & np.isfinite(patch.plain_mm) & ~patch.edge & patch.counted
        )
        even = mask & ~albedo_borders(patch.view)
        if even.sum() > SETTINGS.noise.even_share * mask.sum():
            mask = even
        if mask.any():
            fields.append((patch.depth_mm - patch.plain_mm) / plain_gain(patch.view))
            masks.append(mask)
    if not masks or sum(int(m.sum()) for m in masks) < SETTINGS.noise.off_edges:
        fields = [p.depth_mm - p.plain_mm for p in patches]
        masks = [p.observed & np.isfinite(p.plain_mm) & p.fit for p in patches]
    pitch = _pitch(patches[0])
    own = calibrate(fields, masks, pitch_mm=pitch, missing_share=0.0)
    own = replace(own, tail_share=0.0, tail_sd_mm=SETTINGS.noise.tail_sd * own.sd_mm)
    if not plates:
        return own, None
    reference = calibrate(
        [p.residual_mm / plain_gain(p.view) for p in plates],
        [np.isfinite(p.residual_mm) for p in plates],
        pitch_mm=plates[0].pitch_mm,
        missing_share=float(np.mean([p.missing_share for p in plates])),
    )
    ratio = own.sd_mm / reference.sd_mm
    notes.append(
        f"noise: {1e3 * own.sd_mm:.1f} µm on the part, {1e3 * reference.sd_mm:.1f} µm on the plate"
        f" (ratio {ratio:.2f})"
    )
    usual = SETTINGS.noise.usual_share
    own = replace(
        own,
        tail_share=min(reference.tail_share, usual),
        tail_sd_mm=max(reference.tail_sd_mm, SETTINGS.noise.tail_sd * own.sd_mm),
        missing_share=min(reference.missing_share, usual),
    )
    return own, reference.at_pitch(*pitch)


def nominal_sd_mm(nominal: NoiseModel | None, surface: Surface | None, view: View) -> float:
    """Size of the noise that plates or the surface's file claim; 0 where neither does."""
    if nominal is not None:
        return nominal.sd_mm
    if surface is None:
        return 0.0
    law = geometric_law(view, surface)
    firmware = [e for e in view.sensor.effects if isinstance(e, DeliveryEffect)]
    if not firmware:
        return float(np.hypot(sigma_mm(view.datasheet), law.speckle_sd_mm(view)))
    for effect in firmware:
        law = effect.apply(law, view)
    return float(np.median(law.sd_mm(view)[view.in_range]))


def nominal_noise(
    noise: NoiseModel, nominal: NoiseModel | None, surface: Surface | None, view: View
) -> NoiseModel:
    """Return the noise as the plain model has it."""
    if nominal is not None and nominal.acf.shape == noise.acf.shape:
        return nominal
    return replace(noise, sd_mm=nominal_sd_mm(nominal, surface, view))


def _pitch(patch: "Patch") -> tuple[float, float]:
    x = patch.view.column_x_mm
    travel = np.abs(np.diff(patch.view.travel_mm))
    return float(np.median(np.abs(np.diff(x)))), float(np.median(travel)) if travel.size else 1.0
