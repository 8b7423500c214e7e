"""The world of a case of the second family, and how its poses follow from it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from challenge.instrument.instrument import Solid
from challenge.second.device import Device, Travel
from challenge.second.facets import Facets

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class World:
    """Everything that makes a case's recordings.

    Attributes
    ----------
    device : not yet calibrated
    facets : surface of the part; plates are plain
    solid, nominal : the part as it is, and as the STL has it
    travels, misplaced : commanded scans, and the rigid error of the part's place in each
    mounting : (4, 4) error of the sensor on its flange, sensor -> sensor
    seed : of the case
    gauge_stretch, plate_bow_mm : errors of the plates that the calibration was learnt from
    """

    device: Device
    facets: Facets
    solid: Solid
    nominal: Solid
    travels: tuple[Travel, ...]
    misplaced: tuple[Floats, ...]
    mounting: Floats
    seed: int
    gauge_stretch: float = 0.0
    plate_bow_mm: float = 0.0


Apply = Callable[[World, float, np.random.Generator], World]
Parameters = dict[str, dict[str, float]]


def nothing_stated(_world: World) -> Parameters:
    """Return no parameter: the law of the fault isn't the catalogue's."""
    return {}


@dataclass(frozen=True, kw_only=True, slots=True)
class Fault:
    """One class of departure.

    Attributes
    ----------
    apply : ``apply(world, size, rng)``, by the size of weak, medium and strong faults
    accept : names of the catalogue that are right; empty where none is
    rivals : names that count as honest alternatives
    shapes : parts on which it shows; empty for all
    slow : whether it needs a slow stage
    built : whether it needs a part that was built here, not a mesh from a file
    parameters : effect -> parameter -> value in the world with the fault, where the law is common
    """

    apply: Apply
    accept: tuple[str, ...]
    rivals: tuple[str, ...] = ()
    shapes: tuple[str, ...] = ()
    slow: bool = False
    built: bool = False
    parameters: Callable[[World], Parameters] = nothing_stated


def placed(world: World, index: int) -> Floats:
    """Return the rigid error (4, 4) of a recording's place: the part's, and the mounting's."""
    start = world.travels[index].start
    return np.asarray(world.misplaced[index] @ start @ world.mounting @ np.linalg.inv(start))


def changed(what: str, **change: Callable[[Any, float], Any]) -> Apply:
    """Change fields of the world's ``device`` or ``facets``, each by a function of it and size."""
    def apply(world: World, size: float, _rng: np.random.Generator) -> World:
        now = getattr(world, what)
        fields = {name: value(now, size) for name, value in change.items()}
        new: dict[str, Any] = {what: replace(now, **fields)}
        return replace(world, **new)

    return apply
