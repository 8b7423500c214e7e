"""The surface's finish: whether its noise is as large, as fine, as even as the nominal one.

Compared are the noise on the part, where it is hit squarely, and the plate's (or that of the
surface's file): a factor on its size, a factor on its peaks, a direction along which it is drawn
out on the part.
"""

import cmath
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from diagnosis.data.patch import Patch
from diagnosis.evidence.noise_level import claimed_sizes, level_odds, level_unsure
from diagnosis.fields import Field, Mask
from diagnosis.model.workspace import Model, Workspace
from diagnosis.noise.noise_model import NoiseModel, calibrate, mad_sd
from diagnosis.physics.fit import fit_effect
from diagnosis.physics.uncertainty import Estimate, plain_values
from diagnosis.validate.found_effects import FoundEffect
from sensors.effects.anisotropic_lay import AnisotropicLay
from sensors.effects.base import Effect
from sensors.effects.motion_blur import MotionBlur
from sensors.effects.pixel_locking import PixelLocking
from sensors.effects.roughness_level import RoughnessLevel
from sensors.effects.volume_scattering import VolumeScattering
from sensors.noise.uncertainty import sigma_mm
from sensors.view.view import View

USUAL = 0.1
LEAST_READINGS = 200
LAY_TOLERANCE = math.log(1.3)
"""Least stretch of the noise on the part; sealed nulls have 0.07 at most."""
CORRELATED = 0.05
"""Autocorrelation from which it isn't the measurement's own noise."""
SENSORS_OWN = 0.5
SQUARE_RAD = math.radians(25)
AVERAGED = (
    " Light from within a translucent material averages speckle, too: to tell them apart, spray the"
    " part matt and record again."
)
FINISHED = 0.9
"""Factor on a plate's noise below which it isn't a finish that lowers it.

Speckle of a surface that is rough beyond the wavelength doesn't depend on how rough it is (Dorsch,
Häusler and Herrmann, Appl. Opt. 33 (1994) 1306); light from many depths averages it.
"""
SURELY_LESS = 0.75
"""Factor on a plate's noise that is told beside a bent mean, too, which only adds to noise."""
UNSUNKEN = (
    " It averages speckle; how deep it goes hardly shows. A plate of another finish would do that,"
    " too: to tell them apart, spray the part matt and record again."
)
PARTS = 6
"""Parts of what a cause of noise follows in which the noise is compared by itself."""
BRIGHT = 0.6
"""Share of the readings hit squarely that are darker than those whose noise is compared."""


def level_change(ws: Workspace, model: Model, nominal_sd_mm: float) -> float:
    """Return the logarithm of the part's noise over a nominal one that is sure.

    Measured where the part is bright and hit squarely, in each recording, by the readings' scatter
    and by what neighbours leave of it: a wrong mean adds to the one, a wrong spectrum to the
    other. A finish is the same throughout, so the least change counts: of the recordings, and of
    the parts of what other causes of noise follow, whose laws may be off elsewhere.
    """
    predictions, plain = ws.predict(model), ws.predict(Model())
    noisy = [e for e in model.effects if "variance" in e.channels]
    found: dict[tuple[int, str, int], list[tuple[Field, Field]]] = {}
    for patch, state, with_it, bare in zip(
        ws.patches, ws.states(predictions), predictions, plain, strict=True
    ):
        square = patch.view.incidence_rad < SQUARE_RAD
        # where the model has the noise of a plate, effects on the noise have no say
        usual = np.abs(state.sd_mm / (model.level * ws.noise.sd_mm) - 1) < USUAL
        # where it leaves the mean alone, what it gets wrong there doesn't pass for noise
        still = np.abs(with_it.mean_mm - bare.mean_mm) < USUAL * ws.noise.sd_mm
        pick = patch.fit & state.used & ~patch.edge & square
        for calm in (usual, still):
            if (pick & calm).sum() > LEAST_READINGS:
                pick &= calm
        bright = patch.view.intensity
        if bright is not None and pick.any():
            # dark print is noisier whatever its finish
            pick &= bright >= np.nanquantile(bright[pick], BRIGHT)
        size_mm = model.level * ws.noise.sd_mm
        for name, part, mask in _parts(patch, pick, noisy):
            found.setdefault((patch.recording, name, part), []).append(
                (state.innovations[mask] * size_mm, state.residual_mm[mask])
            )
    changes = [
        math.log(max(_scatter_mm(np.concatenate(kind)), 1e-9) / nominal_sd_mm)
        for values in found.values()
        for kind in zip(*values, strict=True)
        if sum(v.size for v in kind) > LEAST_READINGS
    ]
    alike = changes and (min(changes) > 0 or max(changes) < 0)
    return min(changes, key=abs) if alike else 0.0


def _parts(
    patch: Patch, pick: Mask, noisy: Sequence[Effect]
) -> Iterator[tuple[str, int, Mask]]:
    """Yield readings by what each cause of noise follows; all of them where there is none."""
    if not noisy or not pick.any():
        yield "", 0, pick
        return
    for effect in noisy:
        values = np.broadcast_to(effect.covariate_values(patch.view), patch.shape)
        ends = np.quantile(np.nan_to_num(values[pick]), np.arange(1, PARTS) / PARTS)
        part = np.searchsorted(ends, np.nan_to_num(values))
        for k in range(PARTS):
            yield effect.name, k, pick & (part == k)


def _scatter_mm(values_mm: Field) -> float:
    """Return the standard deviation of values of which some are spikes, mm."""
    around = values_mm - np.median(values_mm)
    cap = 3 * mad_sd(values_mm)
    return float(np.sqrt(np.minimum(np.square(around), cap**2).mean() / 0.995))


def finish_effects(
    ws: Workspace,
    model: Model,
    own: NoiseModel,
    nominal: NoiseModel | None,
    nominal_sd_mm: float,
    usual: Mapping[str, Field],
    *,
    bent: bool = False,
) -> list[Effect]:
    """Effects on the noise's level and direction against a nominal noise.

    Parameters
    ----------
    nominal : the plates' noise; None where only a surface's file is known
    nominal_sd_mm : nominal size; 0 where nothing is claimed
    usual : probability of each component's sizes in a good instrument
    bent : whether much of the mean is left unexplained, which passes for noise: told is no more
        than a lay that draws the noise out by far, whose ridges bend the mean themselves, and noise
        that is far smaller all the same
    """
    effects: list[Effect] = []
    white = sigma_mm(ws.patches[0].view.datasheet)
    if nominal_sd_mm > 0:
        ratio = level_change(ws, model, nominal_sd_mm)
        size = nominal_sd_mm * math.exp(ratio)
        unsure = math.hypot(level_unsure(own), _plates_doubt(model, ws.patches[0].view))
        unsure = math.hypot(unsure, 0.0 if nominal is None else level_unsure(nominal))
        if level_odds(ratio, unsure, claimed_sizes() if nominal is None else usual) > 0:
            amplitude = math.sqrt(
                max(size**2 - white**2, 1e-12) / max(nominal_sd_mm**2 - white**2, 1e-12)
            )
            peaks = 1.0
            if nominal is not None:
                was, now = nominal.correlation_length_px(), own.correlation_length_px()
                peaks = math.sqrt(was[0] * was[1] / max(now[0] * now[1], 1e-9))
                peaks = 1.0 if abs(math.log(peaks)) < 0.3 else peaks
            effects.append(
                RoughnessLevel(
                    amplitude=float(np.clip(amplitude, 0.05, 20)),
                    peaks=float(np.clip(peaks, 0.05, 20)),
                )
            )
    if nominal is not None:
        level = next((e for e in effects if isinstance(e, RoughnessLevel)), None)
        rougher = level is not None and level.amplitude > 1
        lay = _lay(ws, model, nominal, rougher=rougher)
        if lay is not None:
            if level is not None and rougher:
                # the ridges of a lay are what makes it rougher
                effects = []
                lay = replace(lay, amplitude=min(level.amplitude, lay.parameter("amplitude").high))
            effects.append(lay)
    if bent:
        return [e for e in effects if _stands_out(e)]
    return effects


def _stands_out(effect: Effect) -> bool:
    """Whether a finish is told although a bent mean adds to the noise."""
    if isinstance(effect, AnisotropicLay):
        return math.log(effect.ratio) > 2 * LAY_TOLERANCE
    return isinstance(effect, RoughnessLevel) and effect.amplitude < SURELY_LESS


def _plates_doubt(model: Model, view: View) -> float:
    """By how much a plate's noise may be unlike the part's for no finish.

    A plate stands within one camera row or two, the part reaches over many; and it has none of the
    slopes on which a long exposure averages speckle in another way.
    """
    doubt = 0.0
    for effect in model.effects:
        if isinstance(effect, PixelLocking):
            doubt += 4 * math.pi * effect.amplitude_px
        elif isinstance(effect, MotionBlur):
            doubt -= math.log(effect.quieter(view))
    return doubt


def _lay(
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
    tolerance = LAY_TOLERANCE + _plates_doubt(model, ws.patches[0].view)
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


def finish_estimates(effect: Effect) -> dict[str, Estimate]:
    """Return values without intervals: how alike a plate and a part are was not measured."""
    names = (
        "amplitude", "ratio", "angle_deg",
        "median_points", "median_profiles", "mean_points", "mean_profiles",
    )  # fmt: skip
    values = {n: getattr(effect, n, None) for n in names}
    return plain_values({n: float(v) for n, v in values.items() if v is not None})


def sunken(
    ws: Workspace, model: Model, finishes: Sequence[Effect], withheld: Collection[str]
) -> Model:
    """Return the model with the material that averages speckle as no finish does, if it fits.

    How deep it lets the light in shows at edges, if at all: flats sink as a part does that lies
    deeper.
    """
    falls = any(isinstance(e, RoughnessLevel) and e.amplitude < FINISHED for e in finishes)
    if not falls or VolumeScattering.name in {*withheld, *model.names()}:
        return model
    states = ws.states(ws.predict(model))
    fitted = fit_effect(VolumeScattering, ws, model, states, masks=ws.masks())
    if fitted is None or fitted.effect.is_null or fitted.gain <= 0:
        return model
    return model.with_effect(fitted.effect, fitted.own)


def averaged_grain(
    found: Sequence[FoundEffect], beside: Sequence[FoundEffect], withheld: Collection[str]
) -> tuple[tuple[FoundEffect, ...], list[FoundEffect]]:
    """Give a translucent material the fall of its noise: light from many depths averages speckle.

    Returns both lists, without a `roughness_level` that this accounts for; one that may be such
    a fall by itself has the material as its rival.
    """
    volume = next((f for f in found if isinstance(f.effect, VolumeScattering)), None)
    level = next((f for f in beside if isinstance(f.effect, RoughnessLevel)), None)
    if level is None:
        return tuple(found), list(beside)
    assert isinstance(level.effect, RoughnessLevel)
    grain = level.effect.amplitude
    if volume is None:
        if grain >= 1 or VolumeScattering.name in withheld:
            return tuple(found), list(beside)
        either = replace(
            level,
            statement=level.statement + AVERAGED,
            probability=0.5 * level.probability,
            alternatives=((VolumeScattering.name, level.heldout_gain, 0.5 * level.probability),),
        )
        return tuple(found), [either if f is level else f for f in beside]
    low, high = (volume.effect.parameter("grain").low, volume.effect.parameter("grain").high)
    if not low <= grain <= high:
        return tuple(found), list(beside)
    shown = (volume.parameters["depth_um"].low or 0.0) > 0
    sure = max(volume.probability, level.probability)
    both = replace(
        volume, none_of_these=1 - sure,
        effect=volume.effect.with_parameters(grain=grain),
        statement=volume.statement + ("" if shown else UNSUNKEN),
        heldout_gain=volume.heldout_gain + level.heldout_gain,
        parameters={**volume.parameters, "grain": level.parameters["amplitude"]},
        probability=sure if shown else 0.5 * sure,
        alternatives=(
            volume.alternatives
            if shown
            else ((level.name, level.heldout_gain, 0.5 * sure),)
        ),
    )
    return (
        tuple(both if f is volume else f for f in found),
        [f for f in beside if f is not level],
    )
