"""A diagnosis: what was found in recordings, and what it was judged on."""

from collections.abc import Mapping
from dataclasses import dataclass

from diagnosis.data.patch import Patch
from diagnosis.evidence.next_scan import NextScan
from diagnosis.localise.maps import RecordingMaps
from diagnosis.localise.regions import Region
from diagnosis.localise.residual_structure import Residual
from diagnosis.model.model import Model
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.validate.found_effects import FoundEffect
from diagnosis.validate.heldout import Judgement
from sensors.datasheet import Datasheet


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Diagnosis:
    """Everything a report needs.

    Attributes
    ----------
    verdict : match, explained, partly_explained or unexplained
    effects : found, largest held-out gain first
    usual : what the recordings show and good instruments have as well, with the probability that it
        is a fault all the same
    left : structure of the residuals that no named effect explains
    none_of_these : probability that none of the names holds
    population : that set the scales
    assumed : keys that the sensor's file doesn't state, with the values they were given
    regions, share_of_points : where recordings depart from the nominal model
    before, after : nominal model and model with the effects, on held-out readings
    datasheet : the sensor's file with the effects
    fitted, held, baselines : names of recordings
    held_patches, fit_patches : readings that were judged on and fitted
    """

    verdict: str
    effects: tuple[FoundEffect, ...]
    left: tuple[Residual, ...]
    usual: tuple[Residual, ...]
    none_of_these: float
    next_measurements: tuple[NextScan, ...]
    population: str
    assumed: Mapping[str, object]
    regions: tuple[Region, ...]
    share_of_points: float
    before: Judgement
    after: Judgement
    maps: tuple[RecordingMaps, ...]
    datasheet: Datasheet
    model: Model
    noise: NoiseModel
    fitted: tuple[str, ...]
    held: tuple[str, ...]
    baselines: tuple[str, ...]
    held_patches: tuple[Patch, ...]
    fit_patches: tuple[Patch, ...]
    notes: tuple[str, ...]
    seed: int
