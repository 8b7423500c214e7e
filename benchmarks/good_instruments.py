"""What one good instrument shows: of what it departs from the nominal model by, and of changes."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from diagnosis.claims.filtered_noise import FILTER
from diagnosis.claims.firmware import noise_spectra
from diagnosis.claims.lay import LAY, lay_of
from diagnosis.claims.plate_noise import level_change
from diagnosis.data.patch import all_fitted
from diagnosis.discrepancy.good_instrument import (
    change_factors,
    informed,
    kinds_of,
    mean_factors,
    next_changes,
    rate_factors,
)
from diagnosis.discrepancy.learning import factors_alike, factors_of_change
from diagnosis.discrepancy.population import Kind, Population
from diagnosis.evidence.long_waves import long_wave_factors
from diagnosis.evidence.noise_level import AGAINST_PLATES, level_factors, level_unsure
from diagnosis.evidence.seen import channels_seen, seen, together
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.physics.laws_at_edges import factors_at_edges, shown_at_edges
from diagnosis.prepare import Inputs, Prepared, prepared
from diagnosis.usual_sizes import changes_among, good_seen
from pipeline.parts.part import load_part
from sensors.datasheet import Datasheet
from sensors.recording import Recording
from tests.support.small_parts import VIEWS, datasheet, part, record

SIMULATED = ("domes", "steps", "bowl", "wedge", "valley")

Factors = Mapping[str, np.ndarray]
Make = Callable[[], Inputs]
"""Reads the recordings of an instrument, or makes them."""


def inputs_of(folder: Path) -> Inputs:
    """Read the recordings and the plates of a good instrument."""
    part = load_part(folder / "part.stl")
    files = sorted([*folder.glob("rec-*.h5"), *folder.glob("[abc].h5")])
    print(folder, flush=True)
    return Inputs(
        recordings=[Recording.load(f) for f in files], vertices_mm=part.vertices_mm,
        faces=part.faces, datasheet=Datasheet.load(folder / "sensor.yaml"),
        references=[Recording.load(f) for f in sorted(folder.glob("plate*.h5"))],
    )  # fmt: skip


def departures(make: Make) -> Factors:
    """Likelihood of each size of each component in one good instrument's recordings."""
    ready = prepared(make(), [], lambda _: None)
    patches = [p for p in ready.patches if p.fit.any()]
    one = seen(patches, ready.noise, Model())
    channels = channels_seen(patches, ready.noise, Model(), one)
    found = mean_factors(one) | rate_factors(channels.values())
    ws = Workspace.build(patches, ready.noise)
    found |= long_wave_factors(ws)
    if ready.nominal is not None:
        change = level_change(ws, Model(), ready.nominal.sd_mm)
        unsure = np.hypot(change.unsure, level_unsure(ready.nominal))
        found[AGAINST_PLATES] = level_factors(change.log, float(unsure))
    laws = shown_at_edges(one.components, ws)
    return found | spectrum_factors(ready) | factors_at_edges(laws)


def spectrum_factors(ready: Prepared) -> Factors:
    """Likelihood of each size of the lay, and of the filter, that the noise seems to have.

    Where that can be seen.
    """
    if ready.nominal is None:
        return {}
    found: dict[str, np.ndarray] = {}
    ws = Workspace.build(all_fitted(ready.patches), ready.noise)
    lay = lay_of(ws, Model(), ready.nominal, ready.baseline)
    if lay is not None:
        found[LAY] = lay[1]
    spectra = noise_spectra(ready)
    if spectra is not None:
        weighed = spectra.weighed(spectra.names)
        assert weighed is not None
        found[FILTER] = weighed.factors
    return found


@dataclass(frozen=True, kw_only=True, slots=True)
class Beside:
    """What later recordings of a good instrument show beside its first ones as baselines.

    Log factors of sizes, by component.

    Attributes
    ----------
    shown : of the first
    among : of what the first change among themselves
    laws : of what laws at edges do in these changes
    found : of what the later ones change
    columns : how the instrument's file says that columns lie
    """

    shown: Factors
    among: Factors
    laws: Factors
    found: Factors
    columns: str

    def factors_of_change(self, kind: Kind) -> Factors:
        """Likelihood of what the later ones change; see `learning.factors_of_change`.

        Parameters
        ----------
        kind : which the instrument is of
        """
        return {
            name: factors_of_change(
                kind.weights[name], self.shown.get(name, np.zeros(factors.size)), factors
            )
            for name, factors in self.found.items()
            if name in kind.weights
        }

    def factors_alike(self, population: Population) -> Factors:
        """Likelihood of each share of changes that are as those before, by component."""
        population = population.of_files(self.columns)
        kinds = kinds_of(population, self.shown, good=True)
        both = next_changes(population, kinds, {**self.shown, **self.laws}, self.among)
        return {
            name: factors_alike(*both[name], self.found[name])
            for name in self.among.keys() & both.keys() & self.found.keys()
        }


def beside(make: Make, population: Population, count: int) -> Beside:
    """Look at later recordings beside the first ones.

    Parameters
    ----------
    population : what good instruments depart by
    count : of baselines
    """
    inputs = make()
    first, later = inputs.recordings[:count], inputs.recordings[count:]
    ready = prepared(
        replace(inputs, recordings=later, holdout=first[:1], baselines=first), [], lambda _: None
    )
    patches = [p for p in ready.patches if p.fit.any()]
    now = seen(patches, ready.noise, Model())
    good = good_seen(ready, now)
    before = together(good, ready.baseline)
    usual = channels_seen(ready.baseline, ready.noise, Model(), now)
    shown = mean_factors(before) | rate_factors(usual.values())
    population = population.of_files(inputs.datasheet.columns)
    own = informed(population, kinds_of(population, shown, good=True), shown)
    channels = channels_seen(patches, ready.noise, Model(), now)
    base, rest = (Workspace.build(part, ready.noise) for part in (ready.baseline, patches))
    found = {
        **change_factors(now, before, channels, usual, own),
        **spectrum_factors(ready),
        # what a recording shows of a law is its own edges', and says nothing of the next
        **factors_at_edges(shown_at_edges(now.components, rest, base)),
    }
    among, laws = changes_among(ready, good, own)
    return Beside(
        shown=shown, among=among, laws=laws, found=found, columns=inputs.datasheet.columns
    )


def simulated(seed: int) -> Inputs:
    """Make recordings by the plain simulator: Perlin speckle."""
    name = SIMULATED[seed % len(SIMULATED)]
    scene, sheet = part(name), datasheet(100)
    made = [
        record(scene, sheet, [], name=f"r{k}", seed=1000 + 10 * seed + k, profiles=72,
               pitch_mm=0.6, **view)
        for k, view in enumerate(VIEWS)
    ]  # fmt: skip
    return Inputs(
        recordings=made, vertices_mm=scene.vertices_mm, faces=scene.faces, datasheet=sheet
    )
