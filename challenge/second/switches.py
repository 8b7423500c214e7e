"""Physical switches of the second family: what differs from the maker's word; never a depth."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from challenge.cases.parts import bent
from challenge.instrument.instrument import Solid
from challenge.second.device import Device, Travel
from challenge.second.facets import Facets


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
    gauge_stretch, plate_bow_mm : errors of the plates that the calibration was learnt from
    """

    device: Device
    facets: Facets
    solid: Solid
    nominal: Solid
    travels: tuple[Travel, ...]
    misplaced: tuple[NDArray[np.float64], ...]
    mounting: NDArray[np.float64]
    gauge_stretch: float = 0.0
    plate_bow_mm: float = 0.0


Apply = Callable[[World, float, np.random.Generator], World]


@dataclass(frozen=True, kw_only=True, slots=True)
class Fault:
    """One class of departure.

    Attributes
    ----------
    apply : ``apply(world, size, rng)``, size 0.5 weak, 1 medium, 2 strong
    accept : names of the catalogue that are right; empty where none is
    rivals : names that count as honest alternatives
    shapes : parts on which it shows; empty for all
    slow : whether it needs a slow stage
    """

    apply: Apply
    accept: tuple[str, ...]
    rivals: tuple[str, ...] = ()
    shapes: tuple[str, ...] = ()
    slow: bool = False


def _device(**change: Callable[[Device, float], Any]) -> Apply:
    """Change fields of the device, each by a function of it and the size."""

    def apply(world: World, size: float, _rng: np.random.Generator) -> World:
        fields = {name: value(world.device, size) for name, value in change.items()}
        return replace(world, device=replace(world.device, **fields))

    return apply


def _facets(**change: Callable[[Facets, float], float]) -> Apply:
    """Change fields of the part's surface."""

    def apply(world: World, size: float, _rng: np.random.Generator) -> World:
        fields = {name: value(world.facets, size) for name, value in change.items()}
        return replace(world, facets=replace(world.facets, **fields))

    return apply


def _sign(rng: np.random.Generator) -> float:
    return float(rng.choice([-1, 1]))


def _stretched(world: World, size: float, rng: np.random.Generator) -> World:
    return replace(world, gauge_stretch=2.5e-3 * size * _sign(rng))


def _bowed(world: World, size: float, rng: np.random.Generator) -> World:
    return replace(world, plate_bow_mm=0.015 * size * _sign(rng))


def _bent(world: World, size: float, rng: np.random.Generator) -> World:
    sag, twist = 0.03 * size * _sign(rng), 0.02 * size
    return replace(world, solid=bent(world.nominal, sag, twist, int(rng.integers(2**31))))


def _loose(world: World, size: float, rng: np.random.Generator) -> World:
    axis = rng.normal(size=3)
    wrong = np.eye(4)
    turn = np.radians(0.2 * size) * axis / np.linalg.norm(axis)
    wrong[:3, :3] = Rotation.from_rotvec(turn).as_matrix()
    middle = np.array([0.0, 0.0, world.device.distance_mm])
    wrong[:3, 3] = middle - wrong[:3, :3] @ middle + rng.normal(0, 0.1 * size, 3)
    return replace(world, mounting=wrong)


def _printed(world: World, size: float, rng: np.random.Generator) -> World:
    facets = replace(
        world.facets, print_ratio=0.35 / size**0.5, print_period_mm=float(rng.uniform(3, 5)),
        print_rad=float(rng.uniform(0, np.pi)),
    )  # fmt: skip
    return replace(world, facets=facets)


SINGLE: dict[str, Fault] = {
    "coarse chip": Fault(
        apply=_device(camera=lambda d, s: replace(
            d.camera, row_pitch_mm=d.camera.row_pitch_mm * (1.5 + 0.3 * s),
            rows=int(d.camera.rows / (1.5 + 0.3 * s)), blur_rows=0.5)),
        accept=("pixel_locking",), rivals=("roughness_level",)),
    "stretched gauge blocks": Fault(apply=_stretched, accept=("range_scale",)),
    "bowed calibration plate": Fault(
        apply=_bowed, accept=("line_bow",), rivals=("lens_distortion", "form_error")),
    "shaking frame": Fault(
        apply=_device(robot=lambda d, s: replace(d.robot, shake_mm=0.005 * s, shake_hz=23.0)),
        accept=("stage_vibration",)),
    "worn roller": Fault(
        apply=_device(robot=lambda d, s: replace(d.robot, ripple_mm=0.03 * s)),
        accept=("travel_ripple",), rivals=("stage_vibration",)),
    "warming up": Fault(
        apply=_device(warmth=lambda d, s: replace(d.warmth, shift_mm=0.012 * s, constant_s=90.0)),
        accept=("thermal_drift",), slow=True),
    "printed stripes": Fault(apply=_printed, accept=("reflectance_edge",)),
    "long exposure": Fault(
        apply=_device(exposure_s=lambda _, s: 1e-3 * s), accept=("motion_blur",),
        rivals=("finite_spot", "edge_mixing"), shapes=("terraces", "bosses", "waves")),
    "wide slit": Fault(
        apply=_device(slit=lambda d, s: replace(d.slit, width_mm=d.slit.width_mm * (1 + s))),
        accept=("finite_spot",), rivals=("motion_blur", "edge_mixing", "roughness_level")),
    "dark gloss": Fault(
        apply=_facets(albedo=lambda _, s: 0.04 / s, slope_along=lambda *_: 0.2,
                      slope_across=lambda *_: 0.2),
        accept=("specular_dropout",), rivals=("random_dropout", "incidence_noise")),
    "coarse speckle": Fault(
        apply=_facets(modes=lambda f, s: f.modes / (1 + 0.6 * s)),
        accept=("roughness_level",), rivals=("incidence_noise",)),
    "bent part": Fault(apply=_bent, accept=("form_error",)),
    "loose mounting": Fault(apply=_loose, accept=("pose_error",)),
}  # fmt: skip
UNKNOWN: dict[str, Fault] = {
    "median firmware": Fault(
        apply=_device(firmware=lambda d, s: replace(d.firmware, median=5 if s < 1.5 else 9)),
        accept=()),
    "gap filling": Fault(
        apply=_device(firmware=lambda d, _: replace(d.firmware, gap=60)), accept=(),
        shapes=("terraces", "corners")),
    "sticking bit": Fault(
        apply=_device(firmware=lambda d, s: replace(d.firmware, stuck_bit=7 if s < 1.5 else 8)),
        accept=()),
    "lost pulses": Fault(
        apply=_device(robot=lambda d, s: replace(d.robot, lost_mm=0.15 * s)), accept=(),
        shapes=("terraces", "grooves", "bosses", "corners")),
    "wandering robot": Fault(
        apply=_device(robot=lambda d, s: replace(d.robot, wander_mm=0.02 * s,
                                                 wander_rad=3e-4 * s)), accept=()),
    "last peak of a deep gloss": Fault(
        apply=_device(finder=lambda *_: "last", threshold=lambda *_: 0.004), accept=()),
}  # fmt: skip
FAULTS: dict[str, Fault] = {**SINGLE, **UNKNOWN}
