"""Seven families of small parts, drawn anew for each case: 46 x 38 mm, features up to 5 mm high."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from sensors.casting.scene import Scene
from tests.support.small_parts import knots, solid

Floats = NDArray[np.float64]
LENGTH_MM, WIDTH_MM = 46.0, 38.0
_FACET_MM = 0.4


def _fine(height: Callable[[Floats, Floats], Floats]) -> Scene:
    return solid(
        height,
        knots(LENGTH_MM, round(LENGTH_MM / _FACET_MM) + 1),
        knots(WIDTH_MM, round(WIDTH_MM / _FACET_MM) + 1),
    )


def hills(rng: np.random.Generator) -> Scene:
    """Gaussian hills and hollows on a plane: curved everywhere."""
    at = rng.uniform([-18, -14], [18, 14], (6, 2))
    high, wide = rng.uniform(1.5, 5.0, 6) * np.sign(rng.random(6) - 0.25), rng.uniform(5, 9, 6)

    def height(x: Floats, y: Floats) -> Floats:
        return np.asarray(sum(
            h * np.exp(-0.5 * ((x - cx) ** 2 + (y - cy) ** 2) / (0.5 * w) ** 2)
            for (cx, cy), h, w in zip(at, high, wide, strict=True)
        ))  # fmt: skip

    return _fine(height)


def terraces(rng: np.random.Generator) -> Scene:
    """Three blocks with steep walls on a plane."""
    low = rng.uniform([-19, -15], [4, 3], (3, 2))
    size, high = rng.uniform([8, 7], [15, 12], (3, 2)), rng.uniform(1.0, 4.0, 3)
    walls_x = [float(v) for a, s in zip(low, size, strict=True) for v in (a[0], a[0] + s[0])]
    walls_y = [float(v) for a, s in zip(low, size, strict=True) for v in (a[1], a[1] + s[1])]

    def height(x: Floats, y: Floats) -> Floats:
        out = np.zeros_like(x)
        for a, s, h in zip(low, size, high, strict=True):
            inside = (x > a[0]) & (x < a[0] + s[0]) & (y > a[1]) & (y < a[1] + s[1])
            out = np.where(inside, np.maximum(out, h), out)
        return out

    return solid(height, knots(LENGTH_MM, 24, walls_x), knots(WIDTH_MM, 20, walls_y))


def grooves(rng: np.random.Generator) -> Scene:
    """Two V grooves aslant of all travels: sharp concave corners between inclined walls."""
    turn, half = np.radians(rng.uniform(15, 40, 2) * (1, -1)), rng.uniform(4.0, 6.0, 2)
    at, steep = rng.uniform([-12, 5], [-5, 12]), rng.uniform(0.7, 1.0, 2)

    def height(x: Floats, y: Floats) -> Floats:
        out = np.zeros_like(x)
        for a, w, c, s in zip(turn, half, at, steep, strict=True):
            across = np.abs((x - c) * np.cos(a) + y * np.sin(a))
            out = np.minimum(out, s * (across - w))
        return out

    return _fine(height)


def barrel(rng: np.random.Generator) -> Scene:
    """Lie a cylinder down, aslant, on gently curved ground."""
    radius, turn = rng.uniform(9, 14), np.radians(rng.uniform(-35, 35))
    sunk, bend = rng.uniform(0.55, 0.75), rng.uniform(-0.004, 0.004, 2)

    def height(x: Floats, y: Floats) -> Floats:
        across = x * np.cos(turn) + y * np.sin(turn)
        top = np.sqrt(np.maximum(radius**2 - across**2, 0.0)) - sunk * radius
        return np.maximum(top, bend[0] * x**2 + bend[1] * y**2)

    return _fine(height)


def freeform(rng: np.random.Generator) -> Scene:
    """Shape a free form of five waves, slopes up to about 30 degrees."""
    waves = rng.uniform(0.12, 0.4, (5, 2)) * rng.choice([-1, 1], (5, 2))
    size, phase = rng.uniform(0.3, 0.8, 5), rng.uniform(0, 2 * np.pi, 5)

    def height(x: Floats, y: Floats) -> Floats:
        return np.asarray(sum(
            a * np.sin(k[0] * x + k[1] * y + p) for k, a, p in zip(waves, size, phase, strict=True)
        ))  # fmt: skip

    return _fine(height)


def roof(rng: np.random.Generator) -> Scene:
    """Four planes of unequal slope that meet in a peak, with a step beside them."""
    slope, at = rng.uniform(0.12, 0.4, 4), rng.uniform(-4, 4, 2)
    wall, high = float(rng.uniform(10, 15)), rng.uniform(1.0, 2.5)

    def height(x: Floats, y: Floats) -> Floats:
        along, across = x - at[0], y - at[1]
        out = 6.0 - np.where(along > 0, slope[0], slope[1]) * np.abs(along)
        out = out - np.where(across > 0, slope[2], slope[3]) * np.abs(across)
        return np.where(x > wall, out + high, out)

    return solid(
        height, knots(LENGTH_MM, 93, (float(at[0]), wall)), knots(WIDTH_MM, 77, (float(at[1]),))
    )


def ribs(rng: np.random.Generator) -> Scene:
    """Set rounded ribs along one direction and a flat-bottomed pocket."""
    period, high, turn = rng.uniform(7, 10), rng.uniform(0.8, 1.6), np.radians(rng.uniform(20, 70))
    low, size = rng.uniform([-14, -11], [2, 0]), rng.uniform([9, 8], [13, 11])
    walls = [[float(low[i]), float(low[i] + size[i])] for i in (0, 1)]

    def height(x: Floats, y: Floats) -> Floats:
        across = x * np.cos(turn) + y * np.sin(turn)
        out = high * np.cos(np.pi * across / period) ** 2
        inside = (x > walls[0][0]) & (x < walls[0][1]) & (y > walls[1][0]) & (y < walls[1][1])
        return np.where(inside, -1.5, out)

    return solid(height, knots(LENGTH_MM, 116, walls[0]), knots(WIDTH_MM, 96, walls[1]))


PARTS: dict[str, Callable[[np.random.Generator], Scene]] = {
    "hills": hills,
    "terraces": terraces,
    "grooves": grooves,
    "barrel": barrel,
    "freeform": freeform,
    "roof": roof,
    "ribs": ribs,
}


def plate() -> Scene:
    """Return a flat reference plate."""
    return solid(lambda x, _: np.zeros_like(x), knots(60.0, 5), knots(60.0, 5))
