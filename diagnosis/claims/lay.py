"""A lay: the direction on the part along which its noise is drawn out."""

import cmath
import math
from collections.abc import Sequence

import numpy as np

from diagnosis.claims.plate_noise import plates_doubt
from diagnosis.data.patch import Patch
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.noise.noise_model import NoiseModel, calibrate
from sensors.effects.anisotropic_lay import AnisotropicLay

LAY_TOLERANCE = math.log(1.3)
"""Least stretch of the noise on the part; sealed nulls have 0.07 at most."""
CORRELATED = 0.05
"""Autocorrelation from which it isn't the measurement's own noise."""
SENSORS_OWN = 0.5


def lay_of(
    ws: Workspace, model: Model, nominal: NoiseModel, *, rougher: bool
) -> AnisotropicLay | None:
    """Find a direction on the part along which the noise is drawn out.

    Parameters
    ----------
    rougher : whether the noise is larger than a plate's, as ridges make it
    """
    even = _stretch(nominal)
    states = ws.states(ws.predict(model))
    on_part, on_sensor = [], []
    for number in sorted({p.recording for p in ws.patches}):
        members = [
            (p, s) for p, s in zip(ws.patches, states, strict=True) if p.recording == number
        ]
        patches = [p for p, _ in members]
        fields = [s.residual_mm / s.sd_mm for _, s in members]
        masks = [p.fit & s.used & ~p.edge for p, s in members]
        if sum(int(m.sum()) for m in masks) < 3000:
            continue
        own = calibrate(
            fields, masks, pitch_mm=(nominal.pitch_x_mm, nominal.pitch_y_mm), missing_share=0.0,
            from_reference=False,
        )  # fmt: skip
        stretch = _stretch(own) - even
        line, travel = _axes(patches[0])
        mirrored = (travel / line).imag < 0
        on_sensor.append(stretch)
        on_part.append((stretch.conjugate() if mirrored else stretch) * line**2)
    if not on_part:
        return None
    mean = complex(np.mean(on_part))
    size, misfit = abs(mean), _misfit(on_part)
    tolerance = LAY_TOLERANCE + plates_doubt(model, ws.patches[0].view)
    alike = _misfit(on_sensor) < misfit + SENSORS_OWN * size
    drawn = complex(np.mean(on_sensor))
    if alike and abs(drawn.real) > abs(drawn.imag):
        # along its own axes a sensor draws any rougher surface out; ridges do so by far
        if not rougher:
            return None
        tolerance *= 2
    if size < tolerance or misfit > 0.4 * size:
        return None
    angle = math.degrees(0.5 * cmath.phase(mean))
    return AnisotropicLay(ratio=float(np.clip(math.exp(size), 1, 50)), angle_deg=angle)


def _misfit(values: Sequence[complex]) -> float:
    """Largest distance from the mean."""
    return float(np.abs(np.array(values) - np.mean(values)).max())


def _stretch(noise: NoiseModel) -> complex:
    """How noise is drawn out: its size is ln(longest / shortest correlation length).

    Its phase is twice the direction, from the line towards the travel. By the second moments M of
    what of the autocorrelation is positive, a reading's own size added: with L = ln M,
    s = (L_xx - L_yy) / 2 + i L_xy.
    """
    ly, lx = noise.lags
    weight = np.where(noise.acf > CORRELATED, noise.acf, 0.0)
    weight /= weight.sum()
    down, right = np.mgrid[-ly : ly + 1, -lx : lx + 1]
    steps = np.stack([right * noise.pitch_x_mm, down * noise.pitch_y_mm])
    own = np.diag([noise.pitch_x_mm**2, noise.pitch_y_mm**2]) / 12
    values, vectors = np.linalg.eigh(np.einsum("nm,inm,jnm->ij", weight, steps, steps) + own)
    log = vectors @ np.diag(np.log(values)) @ vectors.T
    return complex(0.5 * (log[0, 0] - log[1, 1]), log[0, 1])


def _axes(patch: Patch) -> tuple[complex, complex]:
    """Directions of laser line and travel on the part, from its x towards its y."""
    poses = patch.view.poses
    line, travel = poses[0, :2, 0], poses[-1, :2, 3] - poses[0, :2, 3]
    one, two = (complex(*v) / max(abs(complex(*v)), 1e-9) for v in (line, travel))
    return one, two
