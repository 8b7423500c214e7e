"""Physical switches of the second family: what differs from the maker's file; never a depth."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from challenge.cases.parts import bent, corners, solid_of
from challenge.cases.seeds import child
from challenge.second.coating import Film, Turbid
from challenge.second.device import Device
from challenge.second.facets import Facets
from challenge.second.world import Fault, Parameters, World, changed

SHADOWED = ("terraces", "corners", "grooves")
SLOPED = ("grooves", "bosses", "corners", "waves")
STEPPED = ("terraces", "grooves", "bosses", "corners")


def _sign(rng: np.random.Generator) -> float:
    return float(rng.choice([-1, 1]))


def _stretched(world: World, size: float, rng: np.random.Generator) -> World:
    return replace(world, gauge_stretch=2.5e-3 * size * _sign(rng))


def _bowed(world: World, size: float, rng: np.random.Generator) -> World:
    return replace(world, plate_bow_mm=0.015 * size * _sign(rng))


def _bent(world: World, size: float, rng: np.random.Generator) -> World:
    sag, twist = 0.03 * size * _sign(rng), 0.02 * size
    return replace(world, solid=bent(world.nominal, sag, twist, int(rng.integers(2**31))))


def _sagged(world: World, size: float, rng: np.random.Generator) -> World:
    return replace(world, solid=bent(world.nominal, 0.04 * size * _sign(rng), 0.0, 0))


def _filleted(world: World, size: float, _rng: np.random.Generator) -> World:
    part = corners(child(world.seed, "part"), 0.6 + 0.8 * size)
    return replace(world, solid=solid_of(part))


def _loose(world: World, size: float, rng: np.random.Generator) -> World:
    axis = rng.normal(size=3)
    wrong = np.eye(4)
    turn = np.radians(0.2 * size) * axis / np.linalg.norm(axis)
    wrong[:3, :3] = Rotation.from_rotvec(turn).as_matrix()
    middle = np.array([0.0, 0.0, world.device.distance_mm])
    wrong[:3, 3] = middle - wrong[:3, :3] @ middle + rng.normal(0, 0.1 * size, 3)
    return replace(world, mounting=wrong)


def _albedo_pattern(world: World, size: float, rng: np.random.Generator) -> World:
    facets = replace(
        world.facets, albedo_ratio=0.2 / size**0.5, albedo_period_mm=float(rng.uniform(3, 5)),
        albedo_rad=float(rng.uniform(0, np.pi)),
    )  # fmt: skip
    return replace(world, facets=facets)


def _exposed(world: World, size: float, _rng: np.random.Generator) -> World:
    share = 0.95 * size / (size + 0.5)  # of the time between profiles
    return replace(
        world, device=replace(world.device, exposure_s=share / world.travels[0].rate_hz)
    )


def _oily(world: World, size: float, rng: np.random.Generator) -> World:
    film = Film(thickness_mm=0.03 * size, unevenness=0.9, period_mm=float(rng.uniform(6, 10)))
    return replace(world, facets=replace(world.facets, coat=film))


def _scratched(world: World, size: float, rng: np.random.Generator) -> World:
    half = world.device.camera.x_fov_mm / 2
    window = replace(
        world.device.window, scratch_rows=0.35 * size, scratch_loss=0.3,
        scratch_mm=float(rng.uniform(0.3, 0.6)), scratch_at_mm=float(rng.uniform(-0.5, 0.5)) * half,
        scratch_slant=float(rng.uniform(0.8, 1.6)) * _sign(rng),
    )  # fmt: skip
    return replace(world, device=replace(world.device, window=window))


def _shaken(world: World) -> Parameters:
    robot = world.device.robot
    found = {"amplitude_um": 1e3 * robot.shake_mm}
    if robot.shake_hz < world.travels[0].rate_hz / 2:  # no alias of it
        found["frequency_hz"] = robot.shake_hz
    return {"stage_vibration": found}


def _rippled(world: World) -> Parameters:
    robot = world.device.robot
    return {"travel_ripple": {"amplitude_um": 1e3 * robot.ripple_mm,
                              "period_mm": robot.ripple_period_mm}}  # fmt: skip


def _scaled(world: World) -> Parameters:
    e = world.gauge_stretch  # a true height h (1 + e) was learnt as h
    return {"range_scale": {"error_ppm": -1e6 * e / (1 + e)}}


def _arched(world: World) -> Parameters:
    return {"line_bow": {"sag_um": -1e3 * world.plate_bow_mm}}


def _blurred(world: World) -> Parameters:
    return {"motion_blur": {"exposure_ms": 1e3 * world.device.exposure_s}}


def _lost(world: World) -> Parameters:
    return {"random_dropout": {"share": world.device.firmware.lost}}


def _robot(**of_size: Callable[[float], float]) -> Callable[[Device, float], object]:
    """Change fields of the robot, each by a function of the size."""

    def change(device: Device, size: float) -> object:
        return replace(device.robot, **{name: value(size) for name, value in of_size.items()})

    return change


def _firmware(**of_size: Callable[[float], float]) -> Callable[[Device, float], object]:
    def change(device: Device, size: float) -> object:
        fields: dict[str, Any] = {name: value(size) for name, value in of_size.items()}
        return replace(device.firmware, **fields)

    return change


def _rubber(facets: Facets, size: float) -> Turbid:
    del facets
    return Turbid(free_path_mm=0.15 * size)


SINGLE: dict[str, Fault] = {
    "coarse chip": Fault(
        apply=changed("device", camera=lambda d, s: replace(
            d.camera, row_pitch_mm=d.camera.row_pitch_mm * (1.9 + 1.5 * s),
            rows=int(d.camera.rows / (1.9 + 1.5 * s)), blur_rows=0.3)),
        accept=("pixel_locking",), rivals=("roughness_level",)),
    "stretched gauge blocks": Fault(apply=_stretched, accept=("range_scale",), parameters=_scaled),
    "bowed calibration plate": Fault(
        apply=_bowed, accept=("line_bow",), rivals=("lens_distortion", "form_error"),
        parameters=_arched),
    "skew window": Fault(
        apply=changed("device", window=lambda d, s: replace(d.window, skew_rows=0.04 * s)),
        accept=("lens_distortion",), rivals=("range_scale", "line_bow", "lateral_error")),
    "shaking frame": Fault(
        apply=changed("device", robot=_robot(shake_mm=lambda s: 0.005 * s,
                                             shake_hz=lambda _: 23.0)),
        accept=("stage_vibration",), parameters=_shaken),
    "worn roller": Fault(
        apply=changed("device", robot=_robot(ripple_mm=lambda s: 0.03 * s)),
        accept=("travel_ripple",), rivals=("stage_vibration",), parameters=_rippled,
        shapes=SLOPED),
    "eccentric roller": Fault(
        apply=changed("device", robot=_robot(eccentric_mm=lambda s: 0.012 * s,
                                             roller_mm=lambda _: 0.7)),
        accept=("travel_ripple", "stage_vibration"), shapes=SLOPED),
    "warming up": Fault(
        apply=changed("device", warmth=lambda d, s: replace(d.warmth, shift_mm=0.012 * s,
                                                            constant_s=90.0)),
        accept=("thermal_drift",), slow=True),
    "printed stripes": Fault(apply=_albedo_pattern, accept=("reflectance_edge",)),
    "long exposure": Fault(
        apply=_exposed, accept=("motion_blur",), rivals=("finite_spot", "edge_mixing"),
        shapes=STEPPED, parameters=_blurred),
    "wide slit": Fault(
        apply=changed("device", slit=lambda d, s: replace(d.slit,
                                                          width_mm=d.slit.width_mm * (1 + s))),
        accept=("finite_spot",), rivals=("motion_blur", "edge_mixing", "roughness_level")),
    "dark gloss": Fault(
        apply=changed("facets", albedo=lambda _, s: 0.04 / s, slope_along=lambda *_: 0.2,
                      slope_across=lambda *_: 0.2),
        accept=("specular_dropout",), rivals=("random_dropout", "incidence_noise",
                                              "light_falloff")),
    "shining corner": Fault(
        apply=changed("facets", albedo=lambda *_: 0.08, mirror=lambda _, s: 0.3 * s,
                      slope_along=lambda *_: 0.1, slope_across=lambda *_: 0.1,
                      bounces=lambda *_: True),
        accept=("interreflection",), rivals=("outlier_spikes", "specular_dropout"),
        shapes=("grooves", "corners")),
    "rubber": Fault(
        apply=changed("facets", albedo=lambda *_: 0.25, mirror=lambda *_: 0.02, coat=_rubber),
        accept=("volume_scattering", "incidence_bias"), rivals=("finite_spot", "roughness_level"),
        shapes=SLOPED),
    "clear coat": Fault(
        apply=changed("facets", coat=lambda _, s: Film(thickness_mm=0.08 * s, index=1.5)),
        accept=("volume_scattering", "incidence_bias"), rivals=("interreflection",),
        shapes=SLOPED),
    "coarse speckle": Fault(
        apply=changed("facets", modes=lambda f, s: f.modes / (1 + 0.6 * s)),
        accept=("roughness_level",), rivals=("incidence_noise",)),
    "welding sparks": Fault(
        apply=changed("device", sparks=lambda _, s: 0.008 * s), accept=("outlier_spikes",)),
    "dropping link": Fault(
        apply=changed("device", firmware=_firmware(lost=lambda s: 0.02 * s)),
        accept=("random_dropout",), parameters=_lost),
    "median firmware": Fault(
        apply=changed("device", firmware=_firmware(median=lambda s: 5 if s < 0.6 else 9)),
        accept=("onboard_filter",), rivals=("roughness_level",)),
    "gap filling": Fault(
        apply=changed("device", firmware=_firmware(gap=lambda _: 60)),
        accept=("onboard_filter",), shapes=("terraces", "corners")),
    "bent part": Fault(apply=_bent, accept=("form_error",), built=True),
    "loose mounting": Fault(apply=_loose, accept=("pose_error",)),
}  # fmt: skip
UNKNOWN: dict[str, Fault] = {
    "sticking bit": Fault(
        apply=changed("device", firmware=_firmware(stuck_bit=lambda s: 7 if s < 0.6 else 8)),
        accept=()),
    "lost pulses": Fault(
        apply=changed("device", robot=_robot(lost_mm=lambda s: 0.15 * s)), accept=(),
        shapes=STEPPED),
    "slipping belt": Fault(
        apply=changed("device", robot=_robot(slip_mm=lambda s: 0.12 * s)), accept=(),
        shapes=STEPPED),
    "wandering robot": Fault(
        apply=changed("device", robot=_robot(wander_mm=lambda s: 0.02 * s,
                                             wander_rad=lambda s: 3e-4 * s)), accept=()),
    "hot air": Fault(
        apply=changed("device", air=lambda d, s: replace(d.air, shift_mm=0.006 * s)), accept=()),
    "exposure hunting": Fault(
        apply=changed("device", exposures=lambda d, s: replace(
            d.exposures, gain=1.0 + 0.05 * s, target=0.7)), accept=()),
    "scratched window": Fault(apply=_scratched, accept=()),
    "second reflection": Fault(
        apply=changed("device", window=lambda d, s: replace(d.window, ghost=min(0.75 * s, 0.6))),
        accept=(), shapes=SHADOWED),
    "last peak of a deep gloss": Fault(
        apply=changed("device", finder=lambda *_: "last", threshold=lambda *_: 0.004), accept=()),
}  # fmt: skip
DECOY: dict[str, Fault] = {
    "sagged part": Fault(apply=_sagged, accept=("form_error",), built=True),
    "true fillet": Fault(apply=_filleted, accept=("form_error",), shapes=("corners",), built=True),
    "oil film": Fault(apply=_oily, accept=("form_error",), rivals=("volume_scattering",)),
}
FAULTS: dict[str, Fault] = {**SINGLE, **UNKNOWN, **DECOY}
# One recording can't tell these apart; the right answer is the set.
UNDECIDABLE: dict[str, tuple[str, ...]] = {
    "bowed calibration plate": ("line_bow", "form_error"),
    "sagged part": ("line_bow", "form_error"),
    "long exposure": ("motion_blur", "finite_spot"),
    "skew window": ("lens_distortion", "form_error"),
}
