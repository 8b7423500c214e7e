"""Parts for sealed cases: closed solids of drawn size, in millimetres, z up to the sensor.

Each is a plate of about 34 × 26 mm with features up to 5 mm high in its middle.
"""

from collections.abc import Callable

import manifold3d
import numpy as np
from numpy.typing import NDArray

from challenge.instrument.instrument import Solid

LENGTH_MM, WIDTH_MM, THICK_MM = 36.0, 30.0, 6.0
_SEGMENTS = 256


def _block(x: float, y: float, z: float, at: tuple[float, float, float]) -> manifold3d.Manifold:
    """Box of size (x, y, z) whose bottom's centre is at `at`."""
    return manifold3d.Manifold.cube([x, y, z], False).translate(
        [at[0] - x / 2, at[1] - y / 2, at[2]]
    )


def _plate() -> manifold3d.Manifold:
    return _block(LENGTH_MM, WIDTH_MM, THICK_MM, (0, 0, -THICK_MM))


def _prism(outline: list[tuple[float, float]], length: float) -> manifold3d.Manifold:
    """Extrude a y-z outline (counter-clockwise) along x, centred."""
    flat = manifold3d.CrossSection([np.array(outline)])
    upright = manifold3d.Manifold.extrude(flat, length)  # outline in x-y, height z
    # (x, y, z) -> (z - length / 2, x, y)
    return upright.transform(np.array([[0, 0, 1, -length / 2], [1, 0, 0, 0], [0, 1, 0, 0]], float))


def _turned(solid: manifold3d.Manifold, degrees: float) -> manifold3d.Manifold:
    return solid.rotate([0, 0, degrees])


def terraces(rng: np.random.Generator) -> manifold3d.Manifold:
    """Build terraces and a chamfered block."""
    part = _plate()
    for _ in range(3):
        size = rng.uniform([5, 4, 0.6], [11, 9, 2.5])
        at = (rng.uniform(-8, 8), rng.uniform(-6, 6), -0.5)
        part += _turned(_block(size[0], size[1], size[2] + 0.5, at), rng.choice([0.0, 90.0]))
    high = rng.uniform(1.5, 3.0)
    run = high * rng.uniform(0.8, 1.6)
    wedge = _prism([(-4 - run, -0.5), (4 + run, -0.5), (4, high), (-4, high)], 8.0)
    return part + _turned(wedge, rng.uniform(0, 90)).translate([rng.uniform(-7, 7), 0, 0])


def grooves(rng: np.random.Generator) -> manifold3d.Manifold:
    """Cut V grooves across and along, and set a ramp."""
    part = _plate() + _block(26, 20, 2.5, (0, 0, -0.1))
    for turn in (0.0, 90.0):
        deep = rng.uniform(1.2, 2.2)
        half = deep * rng.uniform(0.9, 1.3)
        rise = 1.0
        cut = _prism(
            [(0, -deep), (half * (1 + rise / deep), rise), (-half * (1 + rise / deep), rise)], 60.0
        ).translate([0, rng.uniform(-5, 5), 2.4])
        part -= _turned(cut, turn + rng.uniform(-8, 8))
    slope = rng.uniform(0.1, 0.3)
    ramp = _prism([(-4, -0.1), (4, -0.1), (4, 0.2 + 8 * slope), (-4, 0.2)], 7.0)
    return part + _turned(ramp, rng.uniform(0, 360)).translate(
        [rng.uniform(-8, 8), rng.uniform(-5, 5), 2.4]
    )


def bosses(rng: np.random.Generator) -> manifold3d.Manifold:
    """Set lying half cylinders, a flat dome and a low boss on the plate."""
    part = _plate()
    for turn in (0.0, 90.0):
        radius = rng.uniform(3, 6)
        bar = manifold3d.Manifold.cylinder(rng.uniform(8, 14), radius, radius, _SEGMENTS, True)
        bar = bar.rotate([0, 90, 0]).translate([0, 0, -radius * rng.uniform(0.4, 0.7)])
        bar = _turned(bar, turn + rng.uniform(-20, 20))
        part += bar.translate([rng.uniform(-8, 8), rng.uniform(-6, 6), 0])
    radius = rng.uniform(8, 14)
    dome = manifold3d.Manifold.sphere(radius, _SEGMENTS)
    part += dome.translate(
        [rng.uniform(-9, 9), rng.uniform(-6, 6), -radius + rng.uniform(0.8, 2.0)]
    )
    puck = manifold3d.Manifold.cylinder(rng.uniform(0.8, 1.6) + 0.5, 3.0, 2.6, _SEGMENTS, False)
    part += puck.translate([rng.uniform(-9, 9), rng.uniform(-7, 7), -0.5])
    keep = _block(60, 60, 40, (0, 0, -THICK_MM))
    return part ^ keep


def corners(rng: np.random.Generator, fillet_mm: float = 0.0) -> manifold3d.Manifold:
    """Set inclined walls that meet the floor in concave corners, filleted or sharp."""
    part = _plate()
    for _ in range(2):
        high = rng.uniform(2.0, 4.0)
        lean = high / np.tan(np.radians(rng.uniform(40, 56)))
        wall = _prism([(-3, -0.5), (3 + lean, -0.5), (3 + lean, 0), (3, high), (-3, high)], 14.0)
        if fillet_mm > 0:
            lean_rad = np.arctan2(high, lean)
            tangent = fillet_mm / np.tan((np.pi - lean_rad) / 2)
            turn = np.linspace(-np.pi / 2, -np.pi / 2 - lean_rad, 33)
            arc = [
                (3 + lean + tangent + fillet_mm * np.cos(a), fillet_mm * (1 + np.sin(a)))
                for a in turn
            ]
            wall += _prism([(3 + lean - 0.2, -0.3), (3 + lean + tangent, -0.3), *arc], 14.0)
        heading = rng.choice([0.0, 90.0, 180.0, 270.0]) + rng.uniform(-10, 10)
        part += _turned(wall, heading).translate([rng.uniform(-7, 7), rng.uniform(-6, 6), 0])
    return part


def waves(rng: np.random.Generator) -> manifold3d.Manifold:
    """Shape a free-form top of gentle slopes, with one pocket."""
    part = _plate().refine_to_length(0.5)
    k = rng.uniform(0.15, 0.45, (4, 2)) * rng.choice([-1, 1], (4, 2))
    a, phase = rng.uniform(0.15, 0.45, 4), rng.uniform(0, 2 * np.pi, 4)

    def lift(points: NDArray[np.float64]) -> NDArray[np.float64]:
        points = np.array(points)
        top = points[:, 2] > -1e-6
        rise = sum(a[i] * np.sin(points[:, :2] @ k[i] + phase[i]) for i in range(4))
        points[:, 2] += np.where(top, rise, 0.0)
        return points

    part = part.warp_batch(lift)
    pocket = _block(rng.uniform(4, 8), rng.uniform(3, 6), 5.0, (0, 0, -rng.uniform(1.0, 2.5)))
    return part - _turned(pocket, rng.uniform(0, 90)).translate(
        [rng.uniform(-7, 7), rng.uniform(-5, 5), 0]
    )


SHAPES: dict[str, Callable[[np.random.Generator], manifold3d.Manifold]] = {
    "terraces": terraces,
    "grooves": grooves,
    "bosses": bosses,
    "corners": corners,
    "waves": waves,
}


def solid_of(shape: manifold3d.Manifold) -> Solid:
    """Mesh of a shape in double precision.

    Raises
    ------
    ValueError
        When the booleans failed.
    """
    if shape.status() != manifold3d.Error.NoError or shape.volume() <= 0:
        raise ValueError(f"the part's solid failed: {shape.status()}")
    mesh = shape.to_mesh64()
    vertices = np.array(mesh.vert_properties[:, :3], np.float64)
    # what the STL's single precision holds is the truth for everybody
    vertices = vertices.astype(np.float32).astype(np.float64)
    return Solid(vertices_mm=vertices, faces=np.array(mesh.tri_verts, np.int64))


def plate(rng: np.random.Generator) -> Solid:
    """Flat reference plate, large enough for any line."""
    del rng
    return solid_of(_block(60, 60, 5, (0, 0, -5)))


def bent(solid: Solid, sag_mm: float, twist_mm: float, seed: int) -> Solid:
    """Return the same part, warped smoothly: a sag over its length and a gentle wave.

    The mesh is refined first, so that long facets bend too.
    """
    mesh = manifold3d.Mesh64(
        vert_properties=solid.vertices_mm, tri_verts=solid.faces.astype(np.uint64)
    )
    fine = manifold3d.Manifold(mesh).refine_to_length(0.6).to_mesh64()
    points = np.array(fine.vert_properties[:, :3], np.float64)
    rng = np.random.default_rng(seed)
    k, phase = rng.uniform(0.15, 0.3, 2), rng.uniform(0, 2 * np.pi)
    points[:, 2] -= sag_mm * (2 * points[:, 0] / LENGTH_MM) ** 2
    points[:, 2] += twist_mm * np.sin(points[:, :2] @ k + phase)
    return Solid(vertices_mm=points, faces=np.array(fine.tri_verts, np.int64))
