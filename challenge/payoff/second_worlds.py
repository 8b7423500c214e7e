"""The worlds of the second family: one physical switch each, of the instrument or the surface.

A stranger gets recordings of the clean part, and what is from the acceptance: file, two scans of a
plate and two of the part.
"""

from collections.abc import Callable
from pathlib import Path as FilePath

import numpy as np
from numpy.typing import NDArray

from challenge.cases.case import BASELINES as BASELINES
from challenge.cases.seeds import child, number
from challenge.payoff.family import Ready, World, first_solid
from challenge.payoff.sights import UprightCamera
from challenge.payoff.specimens import Specimen, make_specimen
from challenge.second.case import stage, travel_over, write
from challenge.second.facets import Facets

PROFILES, LEAN_DEG = 120, 6.0
DOUBLED = 1
"""A fault is twice as large as the strong ones of sealed cases, which are made to be concealed."""

WORLDS: dict[str, World] = {
    "nothing": World(switch="", words="nothing is missing (control)"),
    "shaking": World(switch="shaking frame", words="the frame shakes"),
    "print": World(switch="printed stripes", words="the part has dark stripes of albedo"),
    "sparks": World(switch="welding sparks", words="welding sparks make outliers"),
    "median": World(switch="median firmware", words="the firmware takes a median of nine points"),
    "wide": World(switch="wide slit", words="the laser line is wider", shape="terraces"),
}


def ready(name: str, seed: int) -> Ready:
    """Draw a world's part and instrument and calibrate it."""
    world = WORLDS[name]
    return first_solid(
        name, seed, world, stage,
        family="second", baselines=len(BASELINES), doubled=DOUBLED if world.switch else 0,
    )  # fmt: skip


def write_stranger(world: Ready, folder: FilePath) -> None:
    """Write what a stranger has: recordings of the clean part, and what is from the acceptance."""
    write(world.secret, world.staged, folder)


def specimen(world: Ready, purpose: str, k: int) -> Specimen:
    """Draw a flawed specimen of the world's part, and the path that it is scanned on.

    Parameters
    ----------
    purpose
        ``train`` or ``test``: streams of their own, so that no draw is shared.
    """
    on = world.staged.on
    top = max(float(np.percentile(on.nominal.vertices_mm[:, 2], 90)), 0.5)
    rng = child(world.secret.seed, "payoff", purpose, str(k))
    like = on.travels[0]
    aim = np.array([*rng.uniform(-3, 3, 2), top / 2])
    travel = travel_over(
        rng, on.device, float(rng.uniform(0, 360)), like.pitch_mm, like.rate_hz, PROFILES, 20.0,
        aim, LEAN_DEG,
    )  # fmt: skip
    return make_specimen(on.nominal, UprightCamera(travel=travel, device=on.device), rng)


def scan(world: Ready, purpose: str, k: int, made: Specimen) -> NDArray[np.float32]:
    """Scan a specimen with the world's instrument; every specimen has its own speckle."""
    on, seed = world.staged.on, world.secret.seed
    assert isinstance(made.sight, UprightCamera)
    depth, _ = on.device.scan(
        made.solid, on.facets, made.sight.travel, child(seed, "payoff noise", purpose, str(k)),
        specimen=number(seed, "payoff surface", purpose, str(k)),
    )  # fmt: skip
    return np.asarray(depth, np.float32)


def columns(world: Ready) -> int:
    """Count the readings of a profile."""
    return int(world.staged.on.device.camera.columns)


def pattern(world: Ready) -> Callable[[NDArray[np.float64]], NDArray[np.float64]] | None:
    """Brightness of the part's print at points of it; None without one."""
    facets: Facets = world.staged.on.facets
    return facets.albedo_pattern if facets.albedo_ratio != 1.0 else None
