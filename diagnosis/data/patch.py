"""Patches: the pieces of a recording that are compared, at its registered pose.

A small recording is one patch; a large one is looked at in strips of whole profiles, so that
nothing is resampled and neighbours stay neighbours.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numba import njit

from diagnosis.fields import Field, Mask
from diagnosis.predict.edges import edge_softness, near_edges
from diagnosis.predict.prediction import law_of
from diagnosis.register.placement import PRIOR_SD, Placement
from diagnosis.register.pose_derivative import pose_columns, travel_columns
from diagnosis.register.registration import hits_normal
from diagnosis.settings import SETTINGS
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet
from sensors.model import SensorModel
from sensors.recording import Recording, repeated_rows
from sensors.view.view import View
from sensors.view.view_cache import ViewCache

WHOLE = 450_000
STRIP_ROWS = 40
STRIPS = 5
FEWEST_ROWS = 16
"""Profiles that a strip keeps at least: several correlation lengths."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False, weakref_slot=True)
class Patch:
    """One recording's profiles `rows`, with what geometry says of them.

    Attributes
    ----------
    recording : int
        Number of the recording.
    rows : slice
        Which profiles.
    depth_mm : (n, m)
        Readings; NaN = missing.
    dropped : (n,) bool
        Profiles that repeat the one before: not measurements.
    view : View
        Geometry at the registered pose.
    plain_mm : (n, m)
        Mean of the plain model, NaN where it expects no return.
    columns : (n, m, 9)
        Derivative of depth by the placement; 0 without a hit.
    softness : ((n, m), (n, m))
        Further standard deviation (mm) and probability by which an edge may be misplaced.
    edge : (n, m) bool
        Within reach of a depth edge, a crease or the outline.
    fit, scored : (n, m) bool
        Which readings may be fitted and which are left for judging.
    shift : (9,)
        Placement's correction of the commanded poses, in prior deviations.
    """

    recording: int
    name: str
    rows: slice
    depth_mm: Field
    dropped: Mask
    view: View
    plain_mm: Field
    columns: Field
    softness: tuple[Field, Field]
    edge: Mask
    fit: Mask
    scored: Mask
    shift: Field

    @property
    def shape(self) -> tuple[int, int]:
        """Profiles and points."""
        n, m = self.depth_mm.shape
        return n, m

    @property
    def observed(self) -> Mask:
        """Where there is a reading."""
        return np.asarray(np.isfinite(self.depth_mm))

    @property
    def counted(self) -> Mask:
        """Where a reading or its absence counts: not in dropped profiles."""
        return np.broadcast_to(~self.dropped[:, None], self.shape)


def cut(
    number: int,
    recording: Recording,
    placement: Placement,
    scene: Scene,
    datasheet: Datasheet,
    laser: Laser,
    *,
    lateral_mm: float,
    held_out: Mask | None = None,
) -> list[Patch]:
    """Cut a registered recording into patches.

    Parameters
    ----------
    lateral_mm : float
        How far an edge may be off for no reason of physics: registration, tessellation.
    held_out : (n, m) bool, optional
        Readings that must not be fitted.
    """
    n, m = recording.depth_mm.shape
    repeats = repeated_rows(recording.depth_mm)
    spans = strips(n, m)
    whole = View(
        scene, SensorModel(datasheet), placement.poses, recording.time_s, laser=laser,
        intensity=recording.intensity, start_time_s=recording.start_time_s,
    )  # fmt: skip
    travel = travel_columns(placement.poses)
    patches = []
    for rows in spans:
        view = whole.rows(rows)
        plain = np.array(np.broadcast_to(law_of(view, (), None).mean_mm, view.shape))
        depth = in_range(recording.depth_mm[rows], datasheet)
        columns = pose_columns(
            view.poses,
            laser,
            view.hits.depth_mm,
            hits_normal(scene, view.hits),
            placement.centre_mm,
            travel[rows],
        )
        columns = np.where(np.isfinite(view.depth_mm)[..., None], columns, 0.0) * PRIOR_SD
        edge = near_edges(view, plain)
        softness = edge_softness(view, plain, edge, lateral_mm)
        held = np.zeros(view.shape, dtype=bool) if held_out is None else held_out[rows]
        patches.append(
            Patch(
                recording=number,
                name=recording.name,
                rows=rows,
                depth_mm=depth,
                dropped=repeats[rows],
                view=view,
                plain_mm=plain,
                columns=columns,
                softness=softness,
                edge=edge,
                fit=~held,
                scored=held,
                shift=placement.shift / PRIOR_SD,
            )
        )
    return patches


def thinned(patches: Sequence[Patch], budget: int) -> list[Patch]:
    """Cut strips of whole profiles so that at most about `budget` readings are left."""
    share = budget / sum(p.depth_mm.size for p in patches)
    out: list[Patch] = []
    for patch in patches:
        n = patch.shape[0]
        wanted = max(FEWEST_ROWS, int(n * share))
        count = max(1, min(4, wanted // 24))
        rows = min(wanted // count, n // count)
        starts = np.linspace(0, n - rows, count).astype(int) if count > 1 else [(n - rows) // 2]
        out.extend(strip_of(patch, slice(int(start), int(start) + rows)) for start in starts)
    return out


def strip_of(patch: Patch, part: slice) -> Patch:
    """Take the profiles `part` of a patch, with their place in time and travel; kept with it."""
    return _STRIPS.get(patch, (part.start, part.stop), lambda: _strip_of(patch, part))


def _strip_of(patch: Patch, part: slice) -> Patch:
    start = patch.rows.start
    return replace(
        patch,
        rows=slice(start + part.start, start + part.stop),
        depth_mm=patch.depth_mm[part],
        dropped=patch.dropped[part],
        view=patch.view.rows(part),
        plain_mm=patch.plain_mm[part],
        columns=patch.columns[part],
        softness=(patch.softness[0][part], patch.softness[1][part]),
        edge=patch.edge[part],
        fit=patch.fit[part],
        scored=patch.scored[part],
    )


def strips(profiles: int, points: int) -> list[slice]:
    """Which profiles to look at: all, or strips spread over the recording."""
    if profiles * points <= WHOLE:
        return [slice(0, profiles)]
    rows = int(np.clip(WHOLE // points // STRIPS, STRIP_ROWS, profiles))
    count = min(STRIPS, profiles // rows)
    if count <= 1:
        return [slice(0, profiles)]
    starts = np.linspace(0, profiles - rows, count).astype(int)
    return [slice(int(s), int(s) + rows) for s in starts]


def all_fitted(patches: Sequence[Patch]) -> list[Patch]:
    """Take the readings that are held out for fitted ones: they show the surface, too."""
    return [replace(p, fit=p.fit | p.scored) for p in patches]


def in_range(depth_mm: Field, datasheet: Datasheet) -> Field:
    """Keep readings within the working range; others count as missing."""
    inside = (depth_mm >= datasheet.depth_min_mm) & (depth_mm <= datasheet.depth_max_mm)
    return np.where(inside, depth_mm, np.nan)


def spikes(residual_mm: Field, used: Mask, sd_mm: Field) -> Mask:
    """Mark readings that leave their neighbours: isolated, unlike a misfit, which is smooth."""
    limit_mm = SETTINGS.data.outlier_sd * sd_mm
    limit = np.ascontiguousarray(np.broadcast_to(limit_mm, residual_mm.shape))
    return np.asarray(_spikes(np.ascontiguousarray(residual_mm), used, limit))


_STRIPS: ViewCache[Patch] = ViewCache(8)
"""Strips of a patch, with what their views have seen, for the next search."""


@njit(cache=True)
def _spikes(residual: Field, used: Mask, limit: Field) -> Mask:
    n, m = residual.shape
    out = np.zeros((n, m), dtype=np.bool_)
    near = np.empty(25)
    for i in range(n):
        for j in range(m):
            if not used[i, j] or abs(residual[i, j]) <= limit[i, j]:
                continue
            count = 0
            for a in range(max(i - 2, 0), min(i + 3, n)):
                for b in range(max(j - 2, 0), min(j + 3, m)):
                    if used[a, b]:
                        near[count] = residual[a, b]
                        count += 1
            out[i, j] = abs(residual[i, j] - np.median(near[:count])) > limit[i, j]
    return out
