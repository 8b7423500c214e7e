"""Physical switches: what differs from the maker's file in each class of case.

A switch changes the optics, the surface, the motion, the readout, the calibration or the solid;
never a depth. Strength 0, 1, 2 is weak, medium, strong.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from challenge.cases.devices import Scans
from challenge.cases.parts import bent, corners, solid_of
from challenge.cases.seeds import child
from challenge.instrument.instrument import Instrument, Solid
from challenge.instrument.optical_surface import OpticalSurface


@dataclass(frozen=True, kw_only=True, slots=True)
class World:
    """Everything that makes the recordings.

    Attributes
    ----------
    device
        Not yet calibrated.
    surface
        Of the part; reference plates are diffuse and of one albedo.
    solid
        The part as it is; the STL shows `nominal`.
    """

    device: Instrument
    surface: OpticalSurface
    solid: Solid
    nominal: Solid
    scans: Scans
    seed: int


@dataclass(frozen=True, kw_only=True, slots=True)
class Switch:
    """One class of departure.

    Attributes
    ----------
    apply
        ``apply(world, strength, rng) -> world``.
    accept
        Names of the catalogue that are right answers; empty: none is, the verdict must say so.
    rivals
        Names that count as honest alternatives.
    shapes
        Parts on which it shows; empty for all.
    slow
        True where it needs a slow stage, False where a fast one, None for either.
    """

    apply: Callable[[World, int, np.random.Generator], World]
    accept: tuple[str, ...]
    rivals: tuple[str, ...] = ()
    shapes: tuple[str, ...] = ()
    slow: bool | None = None


def _pick(strength: int, weak: float, medium: float, strong: float,
          rng: np.random.Generator) -> float:  # fmt: skip
    return float((weak, medium, strong)[strength] * rng.uniform(0.85, 1.15))


def _wide_waist(world: World, strength: int, rng: np.random.Generator) -> World:
    sheet = world.device.sheet
    factor = _pick(strength, 1.5, 2.0, 3.0, rng)
    sheet = replace(sheet, waist_mm=sheet.waist_mm * factor)
    return replace(world, device=replace(world.device, sheet=sheet))


def _albedo_pattern(world: World, strength: int, rng: np.random.Generator) -> World:
    surface = replace(
        world.surface,
        albedo_ratio=_pick(strength, 0.5, 0.3, 0.15, rng),
        albedo_period_mm=float(rng.uniform(2.5, 5.0)),
        albedo_angle_rad=float(rng.uniform(0, np.pi)),
    )
    return replace(world, surface=surface)


def _specular_lobe(world: World, strength: int, rng: np.random.Generator) -> World:
    surface = replace(
        world.surface,
        albedo=_pick(strength, 0.035, 0.02, 0.01, rng),
        specular=float(rng.uniform(0.15, 0.3)),
        facet_slope=float(rng.uniform(0.18, 0.3)),
    )
    return replace(world, surface=surface)


def _mirror(world: World, strength: int, rng: np.random.Generator) -> World:
    surface = replace(
        world.surface,
        mirror=_pick(strength, 0.06, 0.15, 0.4, rng),
        facet_slope=float(rng.uniform(0.08, 0.16)),
    )
    device = replace(world.device, finder=replace(world.device.finder, kind="gravity_all"))
    return replace(world, surface=surface, device=device)


def _translucent(world: World, strength: int, rng: np.random.Generator) -> World:
    return replace(
        world, surface=replace(world.surface, depth_mm=_pick(strength, 0.03, 0.07, 0.15, rng))
    )


def _coarse_rows(world: World, strength: int, rng: np.random.Generator) -> World:
    camera, sheet = world.device.camera, world.device.sheet
    sigma = _pick(strength, 0.38, 0.33, 0.28, rng)
    grain = camera.amplitude_spread_mm(sheet.wavelength_mm) / np.sqrt(2)
    seen = np.hypot(sheet.waist_mm * np.cos(camera.triangulation_rad), grain)
    binned = float(seen / sigma)
    rows = int(8 * np.ceil(camera.rows * camera.row_pitch_mm / binned / 8))
    shrink = camera.row_pitch_mm / binned
    camera = replace(
        camera, row_pitch_mm=binned, rows=rows, smile=camera.smile * shrink,
        keystone=camera.keystone * shrink, barrel=camera.barrel * shrink,
    )  # fmt: skip
    return replace(world, device=replace(world.device, camera=camera))


def _column_table(world: World, strength: int, rng: np.random.Generator) -> World:
    plan = replace(
        world.device.plan, column_degree=-1, row_degree=3, heights=12, frames=(8, 4, 2)[strength]
    )
    del rng
    return replace(world, device=replace(world.device, plan=plan))


def _rows_for(world: World, depth_mm: float) -> float:
    return depth_mm * world.device.camera.depth_to_row_slope()


def _bowed_calibration(world: World, strength: int, rng: np.random.Generator) -> World:
    sag = _pick(strength, 0.008, 0.018, 0.04, rng) * float(rng.choice([-1, 1]))
    device = world.device
    if rng.random() < 0.5:
        plan = replace(device.plan, plate_bow_mm=sag)
        return replace(world, device=replace(device, plan=plan))
    camera = replace(device.camera, smile=_rows_for(world, sag), barrel=0.0)
    plan = replace(device.plan, column_degree=1)
    return replace(world, device=replace(device, camera=camera, plan=plan))


def _keystone_left(world: World, strength: int, rng: np.random.Generator) -> World:
    size = _pick(strength, 0.012, 0.03, 0.06, rng) * float(rng.choice([-1, 1]))
    camera = replace(world.device.camera, keystone=_rows_for(world, size), smile=0.0, barrel=0.0)
    plan = replace(world.device.plan, column_degree=0)
    return replace(world, device=replace(world.device, camera=camera, plan=plan))


def _stretched_gauge(world: World, strength: int, rng: np.random.Generator) -> World:
    stretch = _pick(strength, 1e-3, 2.5e-3, 6e-3, rng) * float(rng.choice([-1, 1]))
    plan = replace(world.device.plan, gauge_stretch=stretch)
    return replace(world, device=replace(world.device, plan=plan))


def _mounting(world: World, strength: int, rng: np.random.Generator) -> World:
    size = np.radians(_pick(strength, 0.08, 0.2, 0.5, rng))
    axis = rng.normal(size=3)
    turn = size * axis / np.linalg.norm(axis)
    shift = rng.normal(0, (0.05, 0.1, 0.2)[strength], 3)
    motion = replace(
        world.device.motion, roll_rad=float(turn[0]), pitch_rad=float(turn[1]),
        yaw_rad=float(turn[2]), mount_mm=(float(shift[0]), float(shift[1]), float(shift[2])),
    )  # fmt: skip
    return replace(world, device=replace(world.device, motion=motion))


def _shaky(world: World, strength: int, rng: np.random.Generator) -> World:
    motion = replace(
        world.device.motion,
        shake_mm=_pick(strength, 0.002, 0.005, 0.012, rng),
        shake_hz=float(rng.uniform(0.05, 0.45) * world.scans.paths[0].rate_hz),
    )
    return replace(world, device=replace(world.device, motion=motion))


def _screw(world: World, strength: int, rng: np.random.Generator) -> World:
    motion = replace(
        world.device.motion,
        ripple_mm=_pick(strength, 0.012, 0.03, 0.07, rng),
        ripple_period_mm=float(rng.uniform(1.5, 5.0)),
    )
    return replace(world, device=replace(world.device, motion=motion))


def _long_exposure(world: World, strength: int, rng: np.random.Generator) -> World:
    path = world.scans.paths[0]
    blur = _pick(strength, 0.15, 0.3, 0.5, rng)
    exposure = blur / (path.pitch_mm * path.rate_hz)
    sheet = replace(world.device.sheet, exposure_s=float(exposure))
    return replace(world, device=replace(world.device, sheet=sheet))


def _warming(world: World, strength: int, rng: np.random.Generator) -> World:
    motion = replace(
        world.device.motion,
        warm_mm=_pick(strength, 0.03, 0.06, 0.15, rng) * float(rng.choice([-1, 1])),
        warm_s=float(rng.uniform(40, 120)),
    )
    return replace(world, device=replace(world.device, motion=motion))


def _spiky(world: World, strength: int, rng: np.random.Generator) -> World:
    faults = replace(world.device.faults, spikes=_pick(strength, 0.003, 0.01, 0.03, rng))
    return replace(world, device=replace(world.device, faults=faults))


def _lossy(world: World, strength: int, rng: np.random.Generator) -> World:
    faults = replace(world.device.faults, lost_share=_pick(strength, 0.005, 0.02, 0.06, rng))
    return replace(world, device=replace(world.device, faults=faults))


def _relief(world: World, strength: int, rng: np.random.Generator, ratio: float) -> World:
    short = float(rng.uniform(0.12, 0.25))
    surface = replace(
        world.surface,
        relief_mm=_pick(strength, 0.006, 0.010, 0.018, rng),
        relief_x_mm=short * ratio,
        relief_y_mm=short,
        relief_angle_rad=float(rng.uniform(0, np.pi)),
        relief_seed=int(rng.integers(2**31)),
    )
    return replace(world, surface=surface)


def _ground(world: World, strength: int, rng: np.random.Generator) -> World:
    return _relief(world, strength, rng, float(rng.uniform(4, 10)))


def _blasted(world: World, strength: int, rng: np.random.Generator) -> World:
    return _relief(world, strength, rng, 1.0)


def _warped(world: World, strength: int, rng: np.random.Generator) -> World:
    sag = _pick(strength, 0.02, 0.05, 0.12, rng) * float(rng.choice([-1, 1]))
    solid = bent(world.nominal, sag, abs(sag) * 0.4, int(rng.integers(2**31)))
    return replace(world, solid=solid)


def _sagged(world: World, strength: int, rng: np.random.Generator) -> World:
    sag = _pick(strength, 0.02, 0.05, 0.12, rng) * float(rng.choice([-1, 1]))
    return replace(world, solid=bent(world.nominal, sag, 0.0, 0))


def _filleted(world: World, strength: int, rng: np.random.Generator) -> World:
    radius = _pick(strength, 0.8, 1.5, 2.5, rng)
    return replace(world, solid=solid_of(corners(child(world.seed, "part"), radius)))


def _missed_counts(world: World, strength: int, rng: np.random.Generator) -> World:
    motion = replace(
        world.device.motion,
        lost_counts_mm=_pick(strength, 0.08, 0.18, 0.4, rng),
        lost_at=tuple(sorted(float(v) for v in rng.uniform(0.15, 0.85, 2))),
    )
    return replace(world, device=replace(world.device, motion=motion))


def _dirty_window(world: World, strength: int, rng: np.random.Generator) -> World:
    faults = replace(
        world.device.faults,
        window_dip=(0.85, 0.93, 0.97)[strength],
        window_at=float(rng.uniform(-0.6, 0.6)),
        window_width=float(rng.uniform(0.1, 0.25)),
    )
    return replace(world, device=replace(world.device, faults=faults))


def _lamps(world: World, strength: int, rng: np.random.Generator) -> World:
    path = world.scans.paths[0]
    camera = replace(
        world.device.camera,
        ambient_e=_pick(strength, 50.0, 62.0, 75.0, rng),
        ambient_ripple=0.9,
        ambient_hz=float(rng.uniform(0.03, 0.1) * path.rate_hz),
        ambient_tilt=0.8,
    )
    finder = replace(world.device.finder, kind="gravity_all")
    return replace(world, device=replace(world.device, camera=camera, finder=finder))


def _stalls(world: World, strength: int, rng: np.random.Generator) -> World:
    faults = replace(world.device.faults, stall_share=_pick(strength, 0.04, 0.1, 0.25, rng))
    return replace(world, device=replace(world.device, faults=faults))


_SLOPED = ("grooves", "bosses", "corners", "waves")

SINGLE: dict[str, Switch] = {
    "finite_spot": Switch(
        apply=_wide_waist,
        accept=("finite_spot", "edge_mixing"),
        rivals=("motion_blur",),
        shapes=("terraces", "grooves", "corners", "bosses"),
    ),
    "reflectance_edge": Switch(apply=_albedo_pattern, accept=("reflectance_edge",)),
    "specular_dropout": Switch(apply=_specular_lobe, accept=("specular_dropout",), shapes=_SLOPED),
    "interreflection": Switch(
        apply=_mirror, accept=("interreflection",), shapes=("grooves", "corners")
    ),
    "volume_scattering": Switch(
        apply=_translucent,
        accept=("volume_scattering", "incidence_bias"),
        rivals=("finite_spot",),
        shapes=("grooves", "bosses", "corners"),
    ),
    "pixel_locking": Switch(apply=_coarse_rows, accept=("pixel_locking",)),
    "column_offset": Switch(apply=_column_table, accept=("column_offset",)),
    "line_bow": Switch(apply=_bowed_calibration, accept=("line_bow",), rivals=("lens_distortion",)),
    "lens_distortion": Switch(
        apply=_keystone_left, accept=("lens_distortion",), rivals=("range_scale", "line_bow")
    ),
    "range_scale": Switch(apply=_stretched_gauge, accept=("range_scale",),
                          rivals=("lens_distortion",)),
    "pose_error": Switch(apply=_mounting, accept=("pose_error",)),
    "stage_vibration": Switch(apply=_shaky, accept=("stage_vibration",)),
    "travel_ripple": Switch(apply=_screw, accept=("travel_ripple",), shapes=_SLOPED),
    "motion_blur": Switch(
        apply=_long_exposure,
        accept=("motion_blur",),
        rivals=("finite_spot", "edge_mixing"),
        shapes=("terraces", "grooves", "corners", "bosses"),
    ),
    "thermal_drift": Switch(apply=_warming, accept=("thermal_drift",), slow=True),
    "outlier_spikes": Switch(apply=_spiky, accept=("outlier_spikes",)),
    "random_dropout": Switch(apply=_lossy, accept=("random_dropout",)),
    "anisotropic_lay": Switch(
        apply=_ground, accept=("anisotropic_lay",), rivals=("roughness_level",)
    ),
    "roughness_level": Switch(
        apply=_blasted, accept=("roughness_level",), rivals=("anisotropic_lay",)
    ),
    "form_error": Switch(apply=_warped, accept=("form_error",)),
    "row_repeat": Switch(apply=_stalls, accept=("row_repeat",), shapes=_SLOPED),
}  # fmt: skip

UNKNOWN: dict[str, Switch] = {
    "lost_counts": Switch(apply=_missed_counts, accept=(), shapes=_SLOPED),
    "dirty_window": Switch(apply=_dirty_window, accept=()),
    "ambient_ripple": Switch(apply=_lamps, accept=()),
}

DECOY: dict[str, Switch] = {
    "warped_part": Switch(apply=_sagged, accept=("form_error",)),
    "true_fillet": Switch(apply=_filleted, accept=("form_error",), shapes=("corners",)),
}
