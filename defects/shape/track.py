"""A path on the surface: from a site both ways, with a turn before each step."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from defects.surface.surface import SiteError, Surface

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Track:
    """Stations along a path.

    Parameters
    ----------
    points_mm, normals, directions
        (n, 3) stations on the surface, smooth unit normals, unit directions (the bisector of the
        path before and after).
    along_mm
        (n,) position along the path, 0 at the start of the walk.
    turn_rad
        (n,) angle between the path before and after each station.
    """

    points_mm: Floats
    normals: Floats
    directions: Floats
    along_mm: Floats
    turn_rad: Floats

    @classmethod
    def walked(
        cls,
        surface: Surface,
        start_mm: Floats,
        direction: Floats,
        forth: tuple[Floats, Floats],
        back: tuple[Floats, Floats] | None = None,
    ) -> Self:
        """Walk from a point forth and, if wanted, back.

        Parameters
        ----------
        surface, start_mm, direction
            Where the walk starts (3,) and which way (3,).
        forth, back
            Lengths of the steps (n,) and the turns (n,) to the left before them.

        Raises
        ------
        SiteError
            When an edge of the part stops the walk.
        """
        points, where = [np.asarray(start_mm)[None]], [np.zeros(1)]
        for sign, leg in ((-1.0, back), (1.0, forth)):
            if leg is None:
                continue
            steps, turns = leg
            walk = surface.walk(
                np.asarray(start_mm)[None], sign * np.asarray(direction)[None],
                steps[None], turns[None],
            )  # fmt: skip
            if not walk.complete.all():
                raise SiteError("the flaw would cross an edge of the part")
            if sign < 0:
                points.insert(0, walk.points_mm[0, ::-1])
                where.insert(0, -np.cumsum(steps)[::-1])
            else:
                points.append(walk.points_mm[0])
                where.append(np.cumsum(steps))
        path = np.concatenate(points)
        onto, normals, _ = surface.project(path)
        chord = np.diff(path, axis=0)
        chord /= np.linalg.norm(chord, axis=1, keepdims=True)
        before = np.concatenate([chord[:1], chord])
        after = np.concatenate([chord, chord[-1:]])
        middle = before + after
        middle -= np.sum(middle * normals, axis=1, keepdims=True) * normals
        middle /= np.linalg.norm(middle, axis=1, keepdims=True)
        # Only the turn within the tangent plane counts; bending with the surface is no corner.
        left = np.cross(normals, middle)
        turn = _angle(after, middle, left) - _angle(before, middle, left)
        return cls(
            points_mm=onto,
            normals=normals,
            directions=middle,
            along_mm=np.concatenate(where),
            turn_rad=turn,
        )


def _angle(vector: Floats, ahead: Floats, left: Floats) -> Floats:
    return np.asarray(np.arctan2(np.sum(vector * left, axis=1), np.sum(vector * ahead, axis=1)))


def smooth_noise(at: Floats, length: float, rng: np.random.Generator) -> Floats:
    """Return random waves of unit variance with wavelengths of `length` and some above, at (n,)."""
    count = 12
    wave = 2 * np.pi / (length * rng.uniform(1.0, 3.0, count))
    phase = rng.uniform(0, 2 * np.pi, count)
    return np.asarray(np.cos(np.multiply.outer(at, wave) + phase).sum(axis=1) * np.sqrt(2 / count))
