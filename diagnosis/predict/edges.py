"""Depth edges: where the plain law is least sure, and by how much.

No mesh and no pose places an edge exactly, and a law's own correction there (a rounded ridge, a
half-covered line) is an approximation. What an edge reads is therefore trusted less, and bulk
physics is judged away from edges; only what lives on edges is looked for there.
"""

import numpy as np

from diagnosis.fields import Field, Mask, widened
from diagnosis.settings import SETTINGS
from sensors.effects.base import Effect
from sensors.effects.form_error import FormError
from sensors.view.covariates import COVARIATES
from sensors.view.view import View

EDGE_COVARIATES = {c.name for c in COVARIATES.values() if c.place == "edges"}
"""Covariates of effects that live on depth edges alone."""
CORNER_COVARIATES = {c.name for c in COVARIATES.values() if c.place == "corners"}
"""Covariates of effects that live in corners, whose readings are edges where walls are near."""


def on_edges(effect: Effect | type[Effect]) -> bool:
    """Whether an effect lives on depth edges and creases alone; a small fillet does."""
    if isinstance(effect, FormError) and effect.fillet_mm > 0:
        return not any(effect.coefficients_um)
    return effect.covariate in EDGE_COVARIATES


def reaches_edges(effect: Effect | type[Effect]) -> bool:
    """Whether an effect lives on depth edges or in corners: off edges it may do next to nothing."""
    return on_edges(effect) or effect.covariate in CORNER_COVARIATES


def edge_softness(
    view: View, plain_mm: Field, edge: Mask, lateral_mm: float
) -> tuple[Field, Field]:
    """Tell by how much the plain law may be off at edges for no reason of physics.

    Parameters
    ----------
    plain_mm : (n, m)
        Mean of the plain model, NaN where it expects no return.
    edge : (n, m) bool
        From `near_edges`.
    lateral_mm : float
        How far an edge may be off sideways.

    Returns
    -------
    sd_mm, chance : (n, m)
        Further standard deviation, and probability that the point is on the other side of an
        outline.
    """
    sd = np.zeros(view.shape)
    chance = np.zeros(view.shape)
    middle = view.depth_mm
    for move in ({"dx_mm": lateral_mm}, {"dy_mm": lateral_mm}):
        ahead = view.shifted(**move).depth_mm
        back = view.shifted(**{k: -v for k, v in move.items()}).depth_mm
        slope = view.slope_x if "dx_mm" in move else view.slope_y
        linear = np.clip(slope, -5, 5) * lateral_mm
        for side, sign in ((ahead, 1.0), (back, -1.0)):
            bend = np.abs(side - middle - sign * linear)
            sd = np.fmax(sd, np.where(np.isfinite(bend), bend, 0.0))
            chance[np.isfinite(side) != np.isfinite(middle)] = SETTINGS.predict.outline_chance
    chance[sd > SETTINGS.predict.step_mm] = SETTINGS.predict.step_chance
    # the law's own correction may be wrong by all of itself
    own = np.where(edge, np.nan_to_num(np.abs(plain_mm - middle)), 0.0)
    seen = _with_border(view, np.isfinite(plain_mm))
    outline = widened(seen, (1, 1)) & widened(~seen, (1, 1))
    chance[outline[1:-1, 1:-1]] = SETTINGS.predict.outline_chance
    return np.hypot(sd, own), chance


def near_edges(view: View, plain_mm: Field) -> Mask:
    """Within reach of a depth edge, a crease or the outline of what is seen, (n, m).

    The reach is three standard deviations of the laser line, two points at least.
    """
    seen = _with_border(view, np.isfinite(plain_mm))
    depth = view.depth_mm
    width_um = view.datasheet.line_width_um
    line_sd_mm = SETTINGS.predict.line_sd_mm if width_um is None else 1e-3 * width_um / 4
    rough = np.zeros(view.shape, dtype=bool)
    reach = []
    steps = np.abs(view.travel_step_mm), np.abs(np.diff(view.column_x_mm))
    for axis, step in enumerate(steps):
        pitch = max(float(np.median(step)), 1e-6) if step.size else 1.0
        reach.append(int(np.clip(np.ceil(3 * line_sd_mm / pitch), 2, 12)))
        second = np.abs(np.diff(depth, n=2, axis=axis))
        typical = float(np.nanmedian(second)) if np.isfinite(second).any() else 0.0
        bent = np.zeros(view.shape, dtype=bool)
        inner = (slice(1, -1), slice(None)) if axis == 0 else (slice(None), slice(1, -1))
        with np.errstate(invalid="ignore"):
            bent[inner] = second > max(
                SETTINGS.predict.crease * pitch, SETTINGS.predict.crease_typical * typical
            )
        rough |= bent
        around = (slice(None), slice(1, -1)) if axis == 0 else (slice(1, -1), slice(None))
        flip = np.diff(seen[around].astype(np.int8), axis=axis) != 0
        ahead = (slice(0, -1), slice(None)) if axis == 0 else (slice(None), slice(0, -1))
        behind = (slice(1, None), slice(None)) if axis == 0 else (slice(None), slice(1, None))
        rough |= flip[ahead] | flip[behind]
    return widened(rough, reach)


def _with_border(view: View, seen: Mask) -> Mask:
    """Surround what is seen (n, m) by what would be, one profile and one column on: (n+2, m+2).

    Where a part ends beside the first column, a pose that is a little off moves its outline in.
    """
    out = np.pad(seen, 1, mode="edge")
    columns = np.diff(view.column_x_mm)
    if columns.size:
        pitch = float(np.median(columns))  # negative where x falls along the profile
        for place, end, sign in ((0, 0, -1.0), (-1, -1, 1.0)):
            out[1:-1, place] = np.isfinite(view.shifted(dx_mm=sign * pitch).depth_mm[:, end])
    step = view.travel_step_mm
    if step.size:
        for place, part, sign in ((0, slice(0, 1), -1.0), (-1, slice(-1, None), 1.0)):
            beside = view.rows(part).shifted(dy_mm=sign * float(step[part][0]))
            out[place, 1:-1] = np.isfinite(beside.depth_mm[0])
    return out
