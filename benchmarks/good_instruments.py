"""What one good instrument shows: of what it departs from the nominal model by, and of changes."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

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
from diagnosis.evidence.seen import channels_seen, seen
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.physics.laws_at_edges import factors_at_edges, shown_at_edges
from diagnosis.prepare import Inputs, Prepared, prepared
from diagnosis.usual_sizes import changes_among
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
    return found | lay_factors(ready) | factors_at_edges(laws)


def lay_factors(ready: Prepared) -> Factors:
    """Likelihood of each size of the lay that the noise seems to have, where that can be seen."""
    if ready.nominal is None:
        return {}
    ws = Workspace.build(all_fitted(ready.patches), ready.noise)
    lay = lay_of(ws, Model(), ready.nominal, ready.baseline)
    return {} if lay is None else {LAY: lay[1]}


def changes(make: Make, population: Population, kind: Kind) -> Factors:
    """Likelihood of what others change beside the first recording, by component.

    See `factors_of_change`.

    Parameters
    ----------
    population : by which the first recording is a baseline
    kind : which the instrument is of
    """
    shown, _, found = beside(make(), population, 1)
    return {
        name: factors_of_change(
            kind.weights[name], shown.get(name, np.zeros(factors.size)), factors
        )
        for name, factors in found.items()
        if name in kind.weights
    }


def again(make: Make, population: Population) -> Factors:
    """Likelihood of each share of changes that are as those before, by component.

    The first two recordings are baselines of the third.
    """
    inputs = make()
    shown, (among, laws), found = beside(inputs, population, 2)
    population = population.of_files(inputs.datasheet.columns)
    kinds = kinds_of(population, shown, good=True)
    both = next_changes(population, kinds, shown | laws, among)
    return {
        name: factors_alike(*both[name], found[name])
        for name in among.keys() & both.keys() & found.keys()
    }


def beside(
    inputs: Inputs, population: Population, count: int
) -> tuple[Factors, tuple[Factors, Factors], Factors]:
    """Look at later recordings beside the first ones as baselines.

    Returns
    -------
    likelihood of each size of each component in the first; of what they change among themselves,
    with what laws at edges do in them; of what the later ones change
    """
    first, later = inputs.recordings[:count], inputs.recordings[count:]
    ready = prepared(
        replace(inputs, recordings=later, holdout=first[:1], baselines=first), [], lambda _: None
    )
    patches = [p for p in ready.patches if p.fit.any()]
    now = seen(patches, ready.noise, Model())
    before = seen(ready.baseline, ready.noise, Model(), like=now)
    usual = channels_seen(ready.baseline, ready.noise, Model(), now)
    shown = mean_factors(before) | rate_factors(usual.values())
    population = population.of_files(inputs.datasheet.columns)
    own = informed(population, kinds_of(population, shown, good=True), shown)
    channels = channels_seen(patches, ready.noise, Model(), now)
    base, rest = (Workspace.build(part, ready.noise) for part in (ready.baseline, patches))
    found = {
        **change_factors(now, before, channels, usual, own),
        **lay_factors(ready),
        # what a recording shows of a law is its own edges', and says nothing of the next
        **factors_at_edges(shown_at_edges(now.components, rest, base)),
    }
    return shown, changes_among(ready, now, own), found


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
