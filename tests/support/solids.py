"""Solids, lasers and paths that the tests of casting share."""

from collections.abc import Iterator

import numpy as np
import trimesh
from numpy.typing import NDArray

from sensors.casting.laser import Laser
from sensors.casting.scene import Scene

Floats = NDArray[np.float64]

LASERS = {
    "fan": Laser(x_mm=np.zeros(201), slope_x=np.tan(np.linspace(-0.5, 0.5, 201))),
    "parallel": Laser(x_mm=np.linspace(-50, 50, 201), slope_x=np.zeros(201)),
    "backwards": Laser(x_mm=np.linspace(50, -50, 201), slope_x=np.zeros(201)),
    "telecentric at an angle": Laser(x_mm=np.linspace(-50, 50, 201), slope_x=np.full(201, 0.2)),
    "widening": Laser(x_mm=np.linspace(-30, 30, 201), slope_x=np.linspace(-0.1, 0.1, 201)),
}


def solids(rng: np.random.Generator) -> Iterator[tuple[str, trimesh.Trimesh]]:
    """Yield closed solids of about 60 mm, smooth, sharp, hollow, rough and of random shape."""
    box = trimesh.creation.box((60, 50, 20))
    yield "box", box
    yield "cylinder", trimesh.creation.cylinder(20, 60, sections=48)
    yield "torus", trimesh.creation.torus(25, 9)
    yield "annulus", trimesh.creation.annulus(10, 30, 20)
    yield "hull", trimesh.PointCloud(rng.normal(size=(60, 3)) * 20).convex_hull
    rough = trimesh.creation.icosphere(3, 25)
    rough.vertices += rng.normal(size=rough.vertices.shape) * 1.5
    yield "rough sphere", rough
    yield "pockets", trimesh.boolean.difference(
        [
            box,
            trimesh.creation.box((15, 12, 20)).apply_translation((4, 3, -6)),
            trimesh.creation.cylinder(4, 50).apply_translation((-15, 5, 0)),
            trimesh.creation.box((0.05, 30, 5)).apply_translation((17, 0, -9)),
        ]
    )
    ball = trimesh.creation.icosphere(3, 20)
    opening = trimesh.creation.box((60, 60, 20)).apply_translation((0, 0, -18))
    yield "shell", trimesh.boolean.difference([ball, trimesh.creation.icosphere(3, 19), opening])


def scene_of(mesh: trimesh.Trimesh) -> Scene:
    """Take the scene of a trimesh mesh."""
    return Scene(mesh.vertices, mesh.faces)


def rotation(rng: np.random.Generator) -> Floats:
    """Draw a rotation (3, 3), uniformly."""
    return np.asarray(trimesh.transformations.random_rotation_matrix(rng.random(3))[:3, :3])


def path(
    centre: Floats, half_mm: float, n: int, *, turned: Floats | None = None, height_mm: float = 100
) -> Floats:
    """Poses (n, 4, 4) of a straight scan over `centre`, looking along `turned`'s z."""
    turned = np.eye(3) if turned is None else turned
    poses = np.tile(np.eye(4), (n, 1, 1))
    poses[:, :3, :3] = turned
    poses[:, :3, 3] = (
        centre
        + np.linspace(-half_mm, half_mm, n)[:, None] * turned[:, 1]
        - height_mm * turned[:, 2]
    )
    return poses
