"""A laser line of finite width, located by its centre of gravity: one operator, many effects.

    z_m(y) = Σ_η L(η) I(y+η) V(y+η) [z(y+η) + κ η cot θ] / Σ_η L I V

L the line's Gaussian profile, I the radiance towards the camera, V its visibility. The part is
cast again at each displaced sub-line: nothing is linearised, since these effects live at edges.
Sub-lines whose depth runs on without a jump from the centre's belong to its peak in the camera's
image; light from beyond a jump makes a second peak, which merges with the first where they are
closer than `merge_mm`, and otherwise wins if it is brighter.
"""

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sensors.view.view import View, ViewFunction

Floats = NDArray[np.float64]

SUB_LINES = 12
REACH = 3.0
"""Half width of the sampled profile in standard deviations."""

FOOTPRINT = np.polynomial.hermite_e.hermegauss(9)
"""Places across a footprint along the line, in standard deviations, and their weights."""

BENT = 0.02
"""Mean depth over a line, less its middle's, over its width: more is a crease (3° and more)."""

STEEPEST = 4.0
"""Depth rise over displacement beyond which neighbouring sub-lines count as a jump (76°)."""


BLOCK_POINTS = 1_000_000
"""Points of a scan that are worked on at a time."""

IntensityAt = Callable[[Floats], Floats]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Line:
    """What the operator gives at each point, (n, m).

    Attributes
    ----------
    depth_mm : the reading; NaN where no light reaches the camera
    spot_mm : plain mean over the sub-lines of the centre's peak: no camera, no brightness
    even_mm : the same with κ η cot θ, which differs where the line is cut
    spread_mm : standard deviation of the depths that `depth_mm` is the mean of
    light : share of the line's light that reaches the camera, 0 to 1
    whole : where every sub-line is seen and belongs to one peak
    """

    depth_mm: Floats
    spot_mm: Floats
    even_mm: Floats
    spread_mm: Floats
    light: Floats
    whole: NDArray[np.bool_]


def sub_lines(sd_mm: float) -> Floats:
    """Displacements (k,) that sample a Gaussian profile: an even number, symmetric, mm.

    Scaled so that their weighted second moment is exactly sd², hence a parabola's bias is exact.
    """
    unit = (np.arange(SUB_LINES) + 0.5) * (2 * REACH / SUB_LINES) - REACH
    weight = np.exp(-0.5 * unit**2)
    return np.asarray(sd_mm * unit / math.sqrt(float(weight @ unit**2 / weight.sum())))


def gaussian_weights(offsets_mm: Floats, sd_mm: Floats | float) -> list[Floats | float]:
    """Weights of `sub_lines(max sd)` for a width that may change over the scan."""
    widest = float(np.nanmax(sd_mm))
    scale = offsets_mm.max() / (REACH * (1 - 1 / SUB_LINES)) / widest
    return [np.exp(-0.5 * np.square(eta / scale / sd_mm)) for eta in offsets_mm]


def line_sd_mm(view: View, line_sd_um: float | None, rayleigh_mm: float | None) -> Floats | float:
    """Return the standard deviation of the line, mm; (n, m) where it grows with defocus.

    The datasheet's 1/e² full width is four standard deviations. Away from the working distance
    it grows as sqrt(1 + ((z - WD) / rayleigh)²), a Gaussian beam's law.
    """
    if line_sd_um is None:
        line_sd_um = view.datasheet.require("line_width_um") / 4
    if not rayleigh_mm:
        return line_sd_um * 1e-3
    off = (view.depth_mm - view.datasheet.working_distance_mm) / rayleigh_mm
    return np.asarray(line_sd_um * 1e-3 * np.sqrt(1.0 + np.where(view.in_range, off, 0.0) ** 2))


def read_line(
    view: View,
    offsets_mm: Floats,
    weights: list[Floats | float],
    *,
    axis: str = "y",
    camera: bool = False,
    visible: bool = False,
    brightness: bool = False,
    radiance: ViewFunction | None = None,
    merge_mm: float | None = None,
    camera_y_mm: float | None = None,
    within_mm: Floats | None = None,
) -> Line:
    """Apply the operator.

    Parameters
    ----------
    view : View
        The scan; sub-lines are its shifted views.
    offsets_mm : (k,) or (k, n) array
        Displacements of the sub-lines, each side in rising distance from the centre once sorted;
        one for all profiles or one for each.
    weights : k floats or (n, m) arrays
        L of each, in the order of `offsets_mm`.
    axis : "x" or "y"
        Along which they are displaced.
    camera : bool
        Add κ η cot θ, cot θ = z / b: light off the laser's plane reads deeper. Needs an angle.
    visible : bool
        Light that the camera can't see doesn't count.
    brightness : bool
        Weigh by the surface's brightness.
    radiance : function of a view, optional
        Weigh by what it says a sub-line's view sends to the camera, (n, m).
    merge_mm : float or None
        Distance of two peaks' readings up to which they merge; None: the centre's peak alone.
    camera_y_mm : float, optional
        The camera's place along y where it isn't the datasheet's.
    within_mm : (k, n) or (k, 1) array, optional
        Where in the line the sub-lines lie, η of the camera's term, where that isn't their
        displacement.
    """
    offsets = offsets_mm if offsets_mm.ndim == 2 else offsets_mm[:, None]
    place = camera_y_mm
    if place is None and (camera or visible):
        place = view.datasheet.camera_offset_mm
    parts = row_blocks(view.shape)
    lines = [
        _read_rows(
            view if len(parts) == 1 else view.rows(part),
            _of_rows(offsets.T, part).T,
            None if within_mm is None else _of_rows(within_mm.T, part).T,
            [_of_rows(w, part) if isinstance(w, np.ndarray) else w for w in weights],
            axis=axis,
            cot_per_mm=1.0 / place if camera and place is not None else 0.0,
            seen_from=place if visible else None,
            intensity=_intensity_rows(view, part) if brightness else None,
            brightness=brightness,
            radiance=radiance,
            merge_mm=merge_mm,
        )
        for part in parts
    ]
    if len(lines) == 1:
        return lines[0]
    fields = [field.name for field in dataclasses.fields(Line)]
    return Line(**{k: np.concatenate([getattr(line, k) for line in lines]) for k in fields})


def row_blocks(shape: tuple[int, int]) -> list[slice]:
    """Profiles of a scan (n, m) in blocks of about `BLOCK_POINTS`."""
    n, m = shape
    rows = max(1, BLOCK_POINTS // max(1, m))
    return [slice(start, min(start + rows, n)) for start in range(0, n, rows)]


def _of_rows(field: Floats, part: slice) -> Floats:
    """Return some rows of a field, all of it where one row serves every profile."""
    return field if len(field) == 1 else field[part]


def _read_rows(
    view: View,
    offsets: Floats,
    within: Floats | None,
    weights: list[Floats | float],
    *,
    axis: str,
    cot_per_mm: float,
    seen_from: float | None,
    intensity: IntensityAt | None,
    brightness: bool,
    radiance: ViewFunction | None,
    merge_mm: float | None,
) -> Line:
    n, _ = view.shape
    middle = offsets.mean(axis=1)
    sums = np.zeros((10, *view.shape))
    whole = view.in_range.copy()
    one = np.ones((1, 1))
    for side in (middle >= 0, middle < 0):
        last_depth, last_offset, joined = view.depth_mm, np.zeros(1), view.in_range.copy()
        order = sorted(np.nonzero(side)[0], key=lambda i: abs(middle[i]))
        places = [offsets[k] if len(offsets[k]) > 1 else offsets[k, 0] for k in order]
        subs = view.shifted_each(places, axis=axis, camera_y_mm=seen_from)
        for k, sub in zip(order, subs, strict=True):
            eta = offsets[k]
            light = one
            if intensity is not None:
                light = intensity(eta)
            elif brightness and sub.brightness is not None:
                light = sub.brightness
            if radiance is not None:
                light = light * radiance(sub)
            _add(
                sums,
                joined,
                whole,
                sub.depth_mm,
                last_depth,
                sub.in_range if seen_from is None else sub.visible_from(seen_from),
                np.broadcast_to(np.abs(eta - last_offset), n),
                np.broadcast_to(cot_per_mm * (eta if within is None else within[k]), n),
                np.atleast_2d(np.asarray(weights[k], dtype=np.float64)),
                light,
            )
            last_depth, last_offset = sub.depth_mm, eta
    return _located(sums, whole, merge_mm)


def bright_line(
    view: View,
    sd_mm: Floats | float,
    radiance: ViewFunction | None = None,
    *,
    axis: str = "y",
    merge_mm: float | None = None,
) -> Line:
    """Read a line whose parts are not equally bright.

    Parameters
    ----------
    sd_mm : standard deviation of the line, one or (n, m)
    radiance : what a sub-line sends to the camera; the surface's brightness where left out
    axis : "y", across the line, or "x": the footprint along it, which doesn't move the image
    merge_mm : see `read_line`; given, light that the camera can't see doesn't count
    """
    offsets = sub_lines(float(np.max(sd_mm)))
    return read_line(
        view, offsets, gaussian_weights(offsets, sd_mm), axis=axis, camera=axis == "y",
        visible=merge_mm is not None, brightness=radiance is None, radiance=radiance,
        merge_mm=merge_mm,
    )  # fmt: skip


def line_mean(view: View, sd_mm: Floats | float, of: ViewFunction) -> Floats:
    """Mean over the line of a function of its sub-lines' views, (n, m).

    Only of those whose depth runs on from the centre's; the centre's own value where none does.
    """
    offsets = sub_lines(float(np.max(sd_mm)))
    total, light = np.zeros(view.shape), np.zeros(view.shape)
    for eta, weight in zip(offsets, gaussian_weights(offsets, sd_mm), strict=True):
        sub = view.shifted(dy_mm=float(eta))
        value = of(sub)
        runs_on = np.abs(sub.depth_mm - view.depth_mm) <= STEEPEST * abs(float(eta))
        counts = weight * (runs_on & np.isfinite(value))
        light += counts
        total += np.where(counts > 0, counts * value, 0.0)
    return np.where(light > 0, total / np.where(light > 0, light, 1.0), of(view))


def centroid_bias_mm(
    view: View, sd_mm: Floats | float, *, along_mm: float = 0.0, creases: bool = False
) -> Floats:
    """Bias of the line's centroid towards the brighter side of a surface that runs on, (n, m) mm.

    0 where the line lies on two levels: little of it is lit there, whatever the
    surface's brightness.

    Parameters
    ----------
    along_mm : standard deviation of a reading's footprint along the line
    creases : only where the line bends, not at an albedo pattern on a face
    """
    # what is known of the part itself is sharper than a recording, which its own line blurred
    drawn = view.reflectance is not None and not creases
    line = bright_line(view, sd_mm, partial(_albedo, along_mm=along_mm) if drawn else None)
    biased = line.whole & (line.light > 0)
    if creases:
        biased &= np.abs(line.spot_mm - view.depth_mm) > BENT * sd_mm
    return np.where(biased, line.depth_mm - line.even_mm, 0.0)


def _albedo(view: View, *, along_mm: float) -> Floats:
    """Brightness of the part itself, averaged over the footprint along the line, (n, m).

    A border that runs askew crosses a wide footprint little by little.
    """
    assert view.reflectance is not None
    if along_mm == 0.0:
        return view.reflectance.at(view.part_mm)
    along = view.poses[:, None, :3, 0] * along_mm
    bright = np.zeros(view.shape)
    for place, weight in zip(*FOOTPRINT, strict=True):
        bright += weight * view.reflectance.at(view.part_mm + place * along)
    return np.asarray(bright / FOOTPRINT[1].sum())


@njit(cache=True)
def _add(
    sums: Floats,
    joined: NDArray[np.bool_],
    whole: NDArray[np.bool_],
    depth: Floats,
    last: Floats,
    counted: NDArray[np.bool_],
    gap: Floats,
    oblique: Floats,
    weight: Floats,
    bright: Floats,
) -> None:
    """Add one sub-line to the sums that `_located` names.

    A sub-line off the laser's plane by η reads deeper by z · `oblique`, oblique = κ η / b.
    """
    n, m = depth.shape
    for i in range(n):
        steepest = STEEPEST * gap[i]
        wi = i if weight.shape[0] > 1 else 0
        bi = i if bright.shape[0] > 1 else 0
        for j in range(m):
            z = depth[i, j]
            w = weight[wi, j if weight.shape[1] > 1 else 0]
            sums[7, i, j] += w
            here = joined[i, j] and abs(z - last[i, j]) <= steepest
            joined[i, j] = here
            seen = counted[i, j]
            if not (here and seen):
                whole[i, j] = False
            if here:
                sums[4, i, j] += w
                sums[5, i, j] += w * z
                sums[6, i, j] += w * z * (1.0 + oblique[i])
            if not seen:
                continue
            light = w * bright[bi, j if bright.shape[1] > 1 else 0]
            if not light > 0.0:
                continue
            k = 0 if here else 2
            read = z * (1.0 + oblique[i])
            sums[k, i, j] += light
            sums[k + 1, i, j] += light * read
            sums[8 + k // 2, i, j] += light * read * read


def _located(sums: Floats, whole: NDArray[np.bool_], merge_mm: float | None) -> Line:
    own_light, own_sum, far_light, far_sum, spot_light, spot_sum, even_sum, total = sums[:8]
    own_square, far_square = sums[8:]
    with np.errstate(divide="ignore", invalid="ignore"):
        own = own_sum / own_light
        spot, even = spot_sum / spot_light, even_sum / spot_light
        light = own_light / total
        depth, square = own, own_square / own_light
        if merge_mm is not None:
            far = far_sum / far_light
            both = (own_sum + far_sum) / (own_light + far_light)
            squares = far_square / far_light, (own_square + far_square) / (own_light + far_light)
            merged, farther = np.abs(own - far) <= merge_mm, far_light > own_light
            depth = np.where(merged, both, np.where(farther, far, own))
            square = np.where(merged, squares[1], np.where(farther, squares[0], square))
            light = (own_light + far_light) / total
        spread = np.sqrt(np.maximum(square - depth**2, 0.0))
    return Line(
        depth_mm=depth, spot_mm=spot, even_mm=even, spread_mm=spread, light=light, whole=whole
    )


def _intensity_rows(view: View, part: slice) -> IntensityAt | None:
    """Return a function of a displacement: a recording's brightness there, between its rows."""
    if view.intensity is None:
        return None
    bright = np.where(np.isfinite(view.intensity), view.intensity, 0.0)
    step, n = view.travel_step_mm[part], len(bright)
    still = step == 0.0

    def at(offset_mm: Floats) -> Floats:
        way = np.where(still, 0.0, offset_mm / np.where(still, 1.0, step))
        rows = np.arange(n, dtype=np.float64)[part] + way
        return np.ascontiguousarray(between_rows(bright, rows))

    return at


def between_rows(field: Floats, row: Floats) -> Floats:
    """Values (k, m) at fractional rows (k,) of a field (n, m), linear between neighbours."""
    n = len(field)
    row = np.clip(row, 0, n - 1)
    low = np.minimum(row.astype(np.int64), max(n - 2, 0))
    share = (row - low)[:, None]
    return np.asarray((1.0 - share) * field[low] + share * field[np.minimum(low + 1, n - 1)])
