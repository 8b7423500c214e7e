"""The maker's predicted mean of one scan: its listed laws, written anew from the formats.

The stranger simulates with the catalogue; the maker must know what that gives at edges before
the file is printed. Own code, so that the challenge stays a stranger to the catalogue; a test
holds the two against each other.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from challenge.instrument.camera import Camera
from challenge.instrument.instrument import Path, Solid
from challenge.instrument.rays import Tree, plant
from challenge.instrument.stripes import first_hits

Floats = NDArray[np.float64]

_SUB_LINES = 12
_REACH = 3.0
_STEEPEST = 4.0  # rise over run beyond which neighbouring sub-lines are a jump


@dataclass(frozen=True, kw_only=True, slots=True)
class Stated:
    """Mean depth (n, m), NaN where the file says that nothing returns; and bare geometry."""

    depth_mm: Floats
    bare_mm: Floats


class Rays:
    """Depth and sight of one scan from displaced places, each cast once.

    Parameters
    ----------
    solid, path, misplaced
        What is scanned, and how.
    camera, z_range_mm
        Of the instrument.
    rows : slice
        Profiles of the path.
    columns : int
        Every how many columns.
    """

    def __init__(
        self,
        solid: Solid,
        path: Path,
        misplaced: Floats,
        camera: Camera,
        z_range_mm: float,
        *,
        rows: slice = slice(None),
        columns: int = 1,
    ) -> None:
        to_sensor = np.linalg.inv(misplaced @ path.start)
        self._vertices = solid.vertices_mm @ to_sensor[:3, :3].T + to_sensor[:3, 3]
        self._faces = solid.faces
        self._tree = plant(self._vertices, self._faces)
        self.camera = camera
        self.columns = columns
        self._limits = (
            camera.working_distance_mm - z_range_mm / 2,
            camera.working_distance_mm + z_range_mm / 2,
        )
        y = path.direction * path.pitch_mm * np.arange(path.profiles, dtype=np.float64)
        self.y_mm = y[rows]
        self._kept: dict[tuple[float, float], tuple[Floats, NDArray[np.bool_]]] = {}

    def at(self, dy_mm: float = 0.0, dx_mm: float = 0.0) -> tuple[Floats, NDArray[np.bool_]]:
        """Depth, NaN out of range, and whether the camera sees it, both (n, m)."""
        key = (round(dy_mm, 6), round(dx_mm, 6))
        if key not in self._kept:
            tree: Tree = self._tree
            if dx_mm:
                tree = plant(self._vertices - np.array([dx_mm, 0.0, 0.0]), self._faces)
            depth, _, seen = first_hits(tree, self.y_mm + dy_mm, self.camera, every=self.columns)
            low, high = self._limits
            with np.errstate(invalid="ignore"):
                inside = (depth >= low) & (depth <= high)
            self._kept[key] = np.where(inside, depth, np.nan), seen & inside
        return self._kept[key]


@dataclass(frozen=True, kw_only=True, slots=True)
class _Line:
    """Centre of gravity of what is seen, plain mean of the middle's own run, light, whole."""

    depth_mm: Floats
    spot_mm: Floats
    light: Floats
    whole: NDArray[np.bool_]


def _spread(sd_um: float, rayleigh_mm: float, rays: Rays) -> Floats:
    """Spread of the line at each point, mm."""
    depth, _ = rays.at()
    if rayleigh_mm == 0:
        return np.full(depth.shape, sd_um * 1e-3)
    off = np.nan_to_num((depth - rays.camera.working_distance_mm) / rayleigh_mm)
    return np.asarray(sd_um * 1e-3 * np.sqrt(1 + off**2))


def _read(
    rays: Rays, sd_mm: Floats, *, along: bool = False, camera: bool = False,
    merge_mm: float | None = None,
) -> _Line:  # fmt: skip
    """Average over a Gaussian line's sub-lines, by their centre of gravity."""
    unit = (np.arange(_SUB_LINES) + 0.5) * (2 * _REACH / _SUB_LINES) - _REACH
    bell = np.exp(-0.5 * unit**2)
    unit = unit / np.sqrt(bell @ unit**2 / bell.sum())
    squeeze = _REACH * (1 - 1 / _SUB_LINES) / unit.max()  # nominal place of a sub-line
    widest = float(sd_mm.max())
    lean = 1 / (rays.camera.side * rays.camera.base_mm) if camera else 0.0
    middle, _ = rays.at()
    own = np.zeros((2, *middle.shape))
    far, spot = np.zeros_like(own), np.zeros_like(own)
    total = np.zeros(middle.shape)
    whole = np.isfinite(middle)
    for side in (1, -1):
        last, at, joined = middle, 0.0, np.isfinite(middle)
        for place in sorted(side * unit[unit > 0] * widest, key=abs):
            depth, seen = rays.at(dx_mm=place) if along else rays.at(dy_mm=place)
            weight = np.exp(-0.5 * (place * squeeze / sd_mm) ** 2)
            with np.errstate(invalid="ignore"):
                joined = joined & (np.abs(depth - last) <= _STEEPEST * abs(place - at))
            lit = seen if camera else np.isfinite(depth)
            whole &= joined & lit
            total += weight
            filled = np.nan_to_num(depth)
            spot += np.where(joined, weight * np.stack([np.ones_like(filled), filled]), 0)
            tilted = weight * np.stack([np.ones_like(filled), filled * (1 + lean * place)])
            own += np.where(joined & lit, tilted, 0)
            far += np.where(~joined & lit, tilted, 0)
            last, at = depth, place
    with np.errstate(invalid="ignore", divide="ignore"):
        mine, theirs = own[1] / own[0], far[1] / far[0]
        depth, light = mine, own[0] / total
        if merge_mm is not None:
            both = (own[1] + far[1]) / (own[0] + far[0])
            brighter = np.where(far[0] > own[0], theirs, mine)
            depth = np.where(np.abs(mine - theirs) <= merge_mm, both, brighter)
            light = (own[0] + far[0]) / total
        return _Line(depth_mm=depth, spot_mm=spot[1] / spot[0], light=light, whole=whole)


def stated(rays: Rays, effects: Sequence[Mapping[str, Any]]) -> Stated:
    """Follow a file's `camera_occlusion`, `finite_spot` and `edge_mixing`.

    Parameters
    ----------
    rays : Rays
    effects
        Entries of the file; others leave the mean alone.
    """
    listed = {entry["name"]: entry for entry in effects}
    bare, seen = rays.at()
    depth = bare.copy()
    if (spot := listed.get("finite_spot")) is not None:
        rayleigh = spot.get("rayleigh_mm", 0.0)
        for axis, sd in ((False, spot["line_sd_um"]), (True, spot.get("along_um", 0.0))):
            if sd > 0:
                wide = _spread(sd, 0.0 if axis else rayleigh, rays)
                depth += np.nan_to_num(_read(rays, wide, along=axis).depth_mm - bare)
    if (mixing := listed.get("edge_mixing")) is not None:
        wide = _spread(mixing["line_sd_um"], mixing.get("rayleigh_mm", 0.0), rays)
        line = _read(rays, wide, camera=True, merge_mm=1e-3 * mixing.get("merge_um", 500.0))
        base = np.where(np.isfinite(line.spot_mm), line.spot_mm, bare)
        mixed = np.isfinite(line.depth_mm) & ~line.whole & (
            line.light >= mixing.get("weakest", 0.2)
        )
        depth += np.where(mixed, line.depth_mm - base, 0.0)
    if (shadow := listed.get("camera_occlusion")) is not None:
        if shadow.get("line_sd_um", 0.0) > 0:
            wide = _spread(shadow["line_sd_um"], 0.0, rays)
            line = _read(rays, wide, camera=True, merge_mm=0.0)
            seen = line.light >= shadow.get("weakest", 0.5)
        depth = np.where(seen, depth, np.nan)
    return Stated(depth_mm=depth, bare_mm=bare)
