"""A filter of the firmware that the sensor's file doesn't list.

Readings that went through one have less noise, of the fast waves alone; a smoother surface has less
of all waves. It is looked for before any other cause, since it smears edges, too: a known window is
then expected like a listed one. Light that spreads in a translucent part smooths the noise as well,
over no window: plates are of another material, baselines mostly of the same.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from diagnosis.claims.drawn_filters import DRAWN_POINTS, filters_on
from diagnosis.claims.filtered import Filtered
from diagnosis.claims.filtered_noise import FILTER, FilterWeighed, weighed
from diagnosis.claims.noise_of_recordings import off_edges
from diagnosis.claims.translucency import SPRAY
from diagnosis.data.patch import all_fitted
from diagnosis.discrepancy.good_instrument import of_any_kind
from diagnosis.discrepancy.population import Population
from diagnosis.evidence.reported_causes import Cause
from diagnosis.fields import Field
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.noise.noise_model import NoiseModel, calibrate
from diagnosis.physics.uncertainty import plain_values
from diagnosis.settings import SETTINGS
from diagnosis.validate.found_effects import FoundEffect, plainly_found
from sensors.effects.onboard_filter import OnboardFilter
from sensors.effects.volume_scattering import VolumeScattering
from sensors.law import geometric_law
from sensors.noise.uncertainty import quantise, sigma_mm
from sensors.surface.surface import Surface
from sensors.view.view import View

if TYPE_CHECKING:
    from diagnosis.prepare import Prepared

@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class NoiseSpectra:
    """Noise of recordings and of before, and what filters would make of it.

    Attributes
    ----------
    names : of the R recordings with enough readings
    now, before : noise, over what the model has
    filters, changes : filters that makers offer, and what each changes (L, R, K), see `log_octaves`
    """

    names: tuple[str, ...]
    now: tuple[NoiseModel, ...]
    before: tuple[NoiseModel, ...]
    filters: tuple[OnboardFilter, ...]
    changes: Field

    def weighed(self, names: Collection[str]) -> FilterWeighed | None:
        """Weigh a filter by some recordings."""
        some = [k for k, name in enumerate(self.names) if name in names]
        if not some:
            return None
        return weighed([self.now[k] for k in some], self.before, self.changes[:, some])


def filtered_readings(
    ready: "Prepared", known: Population, withheld: Collection[str]
) -> tuple["Prepared", list[FoundEffect]]:
    """Name a filter that the sensor's file doesn't list, and expect it in the recordings.

    Recordings held out speak as well. Against plates a translucent part is as likely as a filter of
    unknown form.

    Parameters
    ----------
    known : good instruments
    withheld : names of effects that must not be considered
    """
    listed = {e["name"] for e in ready.recorded.datasheet.effects}
    if OnboardFilter.name in {*withheld, *listed}:
        return ready, []
    spectra = noise_spectra(ready)
    if spectra is None:
        return ready, []
    by_all, by_fitted = (spectra.weighed(names) for names in (spectra.names, ready.fitted))
    assert by_all is not None
    before = 0.0 if by_fitted is None else by_fitted.factors.max()
    good = of_any_kind(known.of_changes if ready.baseline else known, FILTER)
    probability = SETTINGS.probability(by_all.nats(good), OnboardFilter.name)
    if probability <= SETTINGS.reported:
        return ready, []
    effect, unknown = spectra.filters[int(by_all.known.argmax())], by_all.unknown
    by_material = 0.0 if ready.baseline or VolumeScattering.name in withheld else 0.5 * unknown
    of_filter = probability * (1 - by_material)
    found = Filtered(
        effect=effect, probability=of_filter, unknown=(unknown - by_material) / (1 - by_material)
    )
    windows = plain_values({
        key: float(getattr(effect, key)) for key in
        ("median_points", "median_profiles", "mean_points", "mean_profiles")
    })  # fmt: skip
    held = sum(int((p.scored & p.observed).sum()) for p in ready.patches)
    gain = float(by_all.factors.max() - before) / max(held, 1)
    doubt = UNKNOWN if unknown > SETTINGS.reported else ""
    named = plainly_found(effect, gain, windows, probability=of_filter, doubt=doubt)
    rival = VolumeScattering.name, gain, probability * by_material
    if rival[-1] > SETTINGS.offered:
        named = replace(
            named, statement=named.statement + TRANSLUCENT, alternatives=(rival,),
            none_of_these=1 - probability,
        )  # fmt: skip
    return ready.filtered_by(found), [named]


def otherwise_explained(
    ready: "Prepared", causes: Sequence[Cause], by_form: Sequence[FoundEffect], notes: list[str]
) -> tuple["Prepared", list[FoundEffect]]:
    """Take a filter of unknown form back where a translucent material is likelier by the mean.

    That smooths the noise as well, and one mechanism is likelier than two.

    Parameters
    ----------
    by_form : what was named before any cause was weighed
    """
    if ready.filtered is None:
        return ready, list(by_form)
    by_mean = [c.probability for c in causes if c.name == VolumeScattering.name]
    likelier = max(by_mean, default=0.0) > ready.filtered.probability
    if likelier and ready.filtered.unknown > SETTINGS.reported:
        kept = [f for f in by_form if f.name != OnboardFilter.name]
        return replace(ready, filtered=None), kept
    notes.append(f"{OnboardFilter.name}: {BEHIND}")
    return ready, list(by_form)


UNKNOWN = (
    "The noise's spectrum is that of no window that makers offer: of these, the nearest is given."
)
TRANSLUCENT = " Light that spreads in a translucent material smooths the noise" + SPRAY
BEHIND = "behind a filter, the noise doesn't tell how rough a surface is, or whether it has a lay"


def noise_spectra(ready: "Prepared") -> NoiseSpectra | None:
    """Compare the noise of recordings with that of baselines, plates or the surface's file.

    None where none of these tells of it, or where too little was read.
    """
    ws, nominal = Workspace.build(all_fitted(ready.patches), ready.noise), ready.nominal
    if nominal is None and ready.surface is not None:
        nominal = claimed_noise(ready.surface, ws.patches[0].view, ready.noise)
    if nominal is None:
        return None
    recordings = off_edges(ws, Model())
    before = [replace(nominal, sd_mm=nominal.sd_mm / ws.noise.sd_mm)]
    if ready.baseline:
        good = off_edges(Workspace.build(ready.baseline, ws.noise), Model())
        before = [one.noise(nominal) for one in good]
    now = [one.noise(nominal) for one in recordings]
    lags = [min(n.lags) for n in (*now, *before)]
    if not now or not before or min(lags) < SETTINGS.claims.filter_lags:
        return None
    filters, changes = filters_on(recordings, before[0])
    return NoiseSpectra(
        names=tuple(one.patches[0].name for one in recordings), now=tuple(now),
        before=tuple(before), filters=tuple(filters), changes=changes,
    )  # fmt: skip


def claimed_noise(surface: Surface, view: View, own: NoiseModel) -> NoiseModel | None:
    """Noise of a flat of a surface as its file claims it, drawn; None where it claims none."""
    speckle = geometric_law(view, surface).speckle
    if speckle is None:
        return None
    rng, step = np.random.default_rng(0), view.datasheet.step_mm
    pitch = own.pitch_x_mm, own.pitch_y_mm
    at = np.arange(float(DRAWN_POINTS))
    drawn = speckle.sample(pitch[0] * at, pitch[1] * at, rng)
    drawn = drawn - drawn.mean() + sigma_mm(view.datasheet) * rng.standard_normal(drawn.shape)
    return calibrate(
        [quantise(drawn, step)], [np.ones(drawn.shape, dtype=bool)], pitch_mm=pitch,
        missing_share=0.0,
    )  # fmt: skip
