"""The worlds of the first family: one physical switch of the instrument or the surface each.

A world is one part, one instrument and its setting. A stranger gets recordings of the clean part
and what was written when the instrument was accepted: its file and two scans of a plate.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path as FilePath

import numpy as np
from numpy.typing import NDArray

from challenge.cases import files
from challenge.cases.case import PLATES, Secret, Staged, stage, write
from challenge.cases.parts import plate
from challenge.cases.seeds import child, number
from challenge.instrument.instrument import Path
from challenge.instrument.optical_surface import OpticalSurface
from challenge.payoff.family import Ready, World, first_solid
from challenge.payoff.sights import UprightLaser
from challenge.payoff.specimens import Specimen, draw_path, make_specimen

PROFILES = 120
BASELINES: tuple[str, ...] = ()
"""This family keeps no recordings of the part from before."""


WORLDS: dict[str, World] = {
    "nothing": World(switch="", words="nothing is missing (control)"),
    "shaking": World(switch="stage_vibration", words="the stage vibrates"),
    "ground": World(switch="anisotropic_lay", words="the part is ground, not blasted"),
    "print": World(switch="reflectance_edge", words="the part has dark stripes of albedo"),
    "spikes": World(switch="outlier_spikes", words="stray light makes outliers"),
    "wide": World(switch="finite_spot", words="the laser line is out of focus", shape="terraces"),
}


def ready(name: str, seed: int) -> Ready:
    """Draw a world's part and instrument and calibrate it."""
    return first_solid(name, seed, WORLDS[name], _staged)


def _staged(secret: Secret) -> Staged:
    staged = stage(secret)
    scans = staged.on.scans
    short = replace(scans, paths=tuple(_shortened(path) for path in scans.paths))
    return replace(staged, on=replace(staged.on, scans=short), off=replace(staged.off, scans=short))


def _shortened(path: Path) -> Path:
    """Return the middle of a path, `PROFILES` long."""
    less = max(path.profiles - PROFILES, 0)
    start = path.start.copy()
    start[:3, 3] += path.direction * path.pitch_mm * (less // 2) * start[:3, 1]
    return replace(path, start=start, profiles=path.profiles - less)


def write_stranger(world: Ready, folder: FilePath) -> None:
    """Write what a stranger has: recordings of the clean part, file and plates as accepted."""
    write(world.secret, world.staged, folder)
    good, seed = world.staged.off.device, world.secret.seed
    flat = plate(child(seed, "plate"))
    for name, path in zip(PLATES, world.staged.plates, strict=True):
        depth, bright = good.scan(
            flat, OpticalSurface(), path, child(seed, "accepted", name),
            specimen=number(seed, "accepted", name),
        )  # fmt: skip
        files.write_recording(folder / f"{name}.h5", depth, bright, path, name)


def specimen(world: Ready, purpose: str, k: int) -> Specimen:
    """Draw a flawed specimen of the world's part, and the path that it is scanned on.

    Parameters
    ----------
    purpose
        ``train`` or ``test``: streams of their own, so that no draw is shared.
    """
    device = world.staged.on.device
    clean = world.staged.on.nominal
    top = max(float(np.percentile(clean.vertices_mm[:, 2], 90)), 0.5)
    rng = child(world.secret.seed, "payoff", purpose, str(k))
    like = world.staged.on.scans.paths[0]
    path = draw_path(rng, like, device.camera.working_distance_mm, top)
    return make_specimen(clean, UprightLaser(path=path, camera=device.camera), rng)


def scan(world: Ready, purpose: str, k: int, made: Specimen) -> NDArray[np.float32]:
    """Scan a specimen with the world's instrument; every specimen has its own surface."""
    on, seed = world.staged.on, world.secret.seed
    surface = on.surface
    if surface.relief_mm > 0:
        surface = replace(surface, relief_seed=number(seed, "relief", purpose, str(k)))
    assert isinstance(made.sight, UprightLaser)
    depth, _ = on.device.scan(
        made.solid, surface, made.sight.path, child(seed, "payoff noise", purpose, str(k)),
        specimen=number(seed, "payoff surface", purpose, str(k)),
    )  # fmt: skip
    return np.asarray(depth, np.float32)


def columns(world: Ready) -> int:
    """Count the readings of a profile."""
    return int(world.staged.on.device.camera.columns)


def pattern(world: Ready) -> Callable[[NDArray[np.float64]], NDArray[np.float64]] | None:
    """Brightness of the part's print at points of it; None without one."""
    surface: OpticalSurface = world.staged.on.surface
    return surface.brightness if surface.albedo_ratio != 1.0 else None
