"""Families of signatures that a mismatch of the mean may follow: free-form and of each effect.

A family is a handful of fields (mm) whose span is tested at once: hat functions of a covariate,
coarse maps of the scan or the part, or the signature of an effect at one point of its grid. They
come one after the other: all of a large scan's at once would take gigabytes.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from diagnosis.edges import EDGE_COVARIATES
from diagnosis.noise import Field, NoiseModel
from diagnosis.patch import Patch
from diagnosis.prediction import Prediction, predict, starting
from sensors.effects import CATALOGUE, AdditiveEffect
from sensors.effects.base import Effect
from sensors.effects.form_error import FormError
from sensors.typed_yaml import RecipeError
from sensors.view.covariates import COVARIATES
from sensors.view.creases import concave_creases, filled_mm
from sensors.view.view import View

SKIPPED = {
    "roughness_level", "anisotropic_lay", "form_error", "pose_error", "empirical",
    "stage_vibration", "travel_ripple", "column_offset", "onboard_filter", "row_repeat",
    "lateral_error",
}  # fmt: skip
"""Effects that other tests cover: spectrum, free-form maps, placements, rows, columns."""
SCAN = "scan:"
"""How the covariate of one scan's own map begins; its number follows."""
MOST_POINTS = 4
FILLETS_MM = (0.8, 1.6, 3.2)
"""Radii that are looked for in concave corners."""
MOST_CREASES = 16
"""Corners that are looked at, those with the most readings."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Family:
    """Fields that are tested together.

    Attributes
    ----------
    name : str
        "free:<covariate>" or "effect:<name>".
    words : what they depend on, for a report
    frame : sensor, time, travel or part
    fields : for each patch (k, n, m) in mm, or None where the family has nothing there;
        a finding's family has none any more
    effect : the effect and its parameters, where it is one's signature
    """

    name: str
    words: str
    frame: str
    fields: tuple[Field | None, ...]
    effect: Effect | None = None

    @property
    def at_edges(self) -> bool:
        """Whether the signature lives on depth edges alone."""
        return self.effect is not None and self.effect.covariate in EDGE_COVARIATES

    @property
    def at_corners(self) -> bool:
        """Whether it lives on edges or in concave corners, where few readings tell it apart."""
        corner = self.effect is not None and self.effect.covariate == "wall_distance"
        filled = isinstance(self.effect, FormError) and self.effect.fillet_mm > 0
        return corner or filled or self.at_edges


def free_families(patches: Sequence[Patch]) -> Iterator[Family]:
    """Yield smooth dependence on each covariate, maps of sensor, scan and part.

    Brightness is left out: speckle moves it together with the depth, reading by reading.
    """
    for name, count in (
        ("x", 9), ("depth", 8), ("slope_x", 6), ("slope_y", 6), ("incidence", 6),
        ("half_vector", 6), ("clock", 9),
    ):  # fmt: skip
        if name == "clock" and any(p.view.start_time_s is None for p in patches):
            continue
        values = covariate_values(name, patches)
        if values is not None:
            words, frame = COVARIATES[name].words, COVARIATES[name].frame
            yield _free(name, words, frame, hats(values, count))
    x, depth = covariate_values("x", patches), covariate_values("depth", patches)
    if x is not None and depth is not None:
        both = products(hats(x, 5), hats(depth, 4))
        yield _free("x_depth", "place in the field of view", "sensor", both)
    part = [p.view.part_mm for p in patches]
    spread = [
        np.ptp(np.concatenate([c[..., k][np.isfinite(c[..., k])] for c in part])) for k in range(3)
    ]
    first, second = np.argsort(spread)[::-1][:2]
    both = products(hats([c[..., first] for c in part], 6), hats([c[..., second] for c in part], 6))
    yield _free("part", "place on the part", "part", both)
    for number in sorted({p.recording for p in patches}):
        rows = [
            np.broadcast_to(np.arange(p.rows.start, p.rows.stop, dtype=float)[:, None], p.shape)
            if p.recording == number else None
            for p in patches
        ]  # fmt: skip
        columns = [
            np.broadcast_to(np.arange(p.shape[1], dtype=float)[None, :], p.shape)
            if p.recording == number else None
            for p in patches
        ]  # fmt: skip
        both = products(hats(rows, 6), hats(columns, 6))
        yield _free(f"{SCAN}{number}", "place in the scan", "part", both)


def _free(name: str, words: str, frame: str, fields: Sequence[Field | None]) -> Family:
    return Family(name=f"free:{name}", words=words, frame=frame, fields=tuple(fields))


def effect_families(
    patches: Sequence[Patch],
    base: Sequence[Prediction],
    noise: NoiseModel,
    *,
    accepted: Sequence[Effect] = (),
    withheld: Iterable[str] = (),
) -> Iterator[Family]:
    """Yield the signature in the mean of every catalogued effect over its coarse grid."""
    names = {effect.name for effect in accepted} | set(withheld) | SKIPPED
    for name, kind in CATALOGUE.items():
        if name in names or "mean" not in kind.channels:
            continue
        for effect in grid_of(kind, patches[0].view):
            fields = mean_signature(effect, patches, base, noise, accepted)
            if fields is None:
                break
            yield Family(
                name=f"effect:{name}",
                words=COVARIATES[effect.covariate].words,
                frame=effect.frame,
                fields=tuple(fields),
                effect=effect,
            )


def fillet_families(
    patches: Sequence[Patch], accepted: Sequence[Effect], withheld: Iterable[str]
) -> Iterator[Family]:
    """Yield fillets of some radii in concave corners."""
    if FormError.name not in {effect.name for effect in accepted} | set(withheld):
        found = (fillet_family(patches, radius_mm) for radius_mm in FILLETS_MM)
        yield from (family for family in found if family is not None)


def fillet_family(patches: Sequence[Patch], radius_mm: float) -> Family | None:
    """Return fillets of one radius, each concave corner by itself; None where none is met."""
    creases = len(concave_creases(patches[0].view.scene).middle_mm)
    if creases == 0:
        return None
    filled = [filled_mm(p.view, radius_mm) for p in patches]
    count = np.zeros(creases, dtype=np.int64)
    for patch, (gone, crease) in zip(patches, filled, strict=True):
        count += np.bincount(crease[patch.fit & (gone > 0)], minlength=creases)
    met = np.argsort(-count, kind="stable")[:MOST_CREASES]
    met = met[count[met] > 0]
    if met.size == 0:
        return None
    fields = [
        np.stack([np.where(crease == k, -gone, 0.0) for k in met]) for gone, crease in filled
    ]
    return Family(
        name=f"effect:{FormError.name}",
        words="distance from a concave corner",
        frame="part",
        fields=tuple(fields),
        effect=FormError(coefficients_um=(), fillet_mm=radius_mm),
    )


def grid_of(kind: type[Effect], view: View) -> tuple[Effect, ...]:
    """Points of an effect's coarse grid, a few; an effect that can't be made has none."""
    try:
        points = starting(kind, view).grid(view)
    except (RecipeError, TypeError):
        return ()
    step = max(1, int(np.ceil(len(points) / MOST_POINTS)))
    return points[step // 2 :: step]


def mean_signature(
    effect: Effect,
    patches: Sequence[Patch],
    base: Sequence[Prediction],
    noise: NoiseModel,
    accepted: Sequence[Effect],
) -> list[Field] | None:
    """Fields (k, n, m) by which an effect changes the mean; None where it can't be computed."""
    out: list[Field] = []
    try:
        for patch, plain in zip(patches, base, strict=True):
            basis = effect.basis(patch.view) if isinstance(effect, AdditiveEffect) else None
            if basis is not None:
                fields = basis.fields
                out.append(
                    np.stack([np.nan_to_num(np.broadcast_to(f, patch.shape)) for f in fields])
                )
            else:
                changed = predict(patch.view, (*accepted, effect), noise)
                out.append(np.nan_to_num(changed.mean_mm - plain.mean_mm)[None])
    except RecipeError:
        return None
    return out if any(np.any(f) for f in out) else None


def covariate_values(name: str, patches: Sequence[Patch]) -> list[Field] | None:
    """Values of a covariate on each patch, or None where it isn't known."""
    covariate = COVARIATES[name]
    try:
        for key in covariate.needs:
            patches[0].view.datasheet.require(key)
        values = [np.broadcast_to(covariate.values(p.view), p.shape) for p in patches]
    except RecipeError:
        return None
    known = np.concatenate([v[np.isfinite(v)][:1000] for v in values])
    return values if known.size and np.ptp(known) > 0 else None


def hats(values: Sequence[Field | None], count: int) -> list[Field | None]:
    """Piecewise linear hat functions with knots spread between quantiles and even steps."""
    known = np.concatenate(
        [v[np.isfinite(v)].ravel()[:: max(1, v.size // 20000)] for v in values if v is not None]
    )
    if known.size == 0:
        return [None if v is None else np.zeros((1, *v.shape)) for v in values]
    by_rank = np.quantile(known, np.linspace(0, 1, count))
    knots = 0.5 * by_rank + 0.5 * np.linspace(known.min(), known.max(), count)
    knots = np.unique(knots)
    return [None if v is None else hat_fields(v, knots) for v in values]


def hat_fields(values: Field, knots: Field) -> Field:
    """Hat functions (k, n, m) of a covariate; their sum is 1 within the knots, 0 where NaN."""
    if knots.size < 2:
        return np.isfinite(values).astype(np.float64)[None]
    inside = np.clip(np.nan_to_num(values, nan=knots[0]), knots[0], knots[-1])
    left = np.clip(np.searchsorted(knots, inside, side="right") - 1, 0, knots.size - 2)
    share = (inside - knots[left]) / (knots[left + 1] - knots[left])
    known = np.isfinite(values)
    out = np.zeros((knots.size, *values.shape))
    rows, columns = np.indices(values.shape)
    out[left, rows, columns] = np.where(known, 1 - share, 0.0)
    out[left + 1, rows, columns] = np.where(known, share, 0.0)
    return out


def products(first: Sequence[Field | None], second: Sequence[Field | None]) -> list[Field | None]:
    """Tensor products of two sets of hats, patch by patch."""
    return [
        None if a is None or b is None
        else (a[:, None] * b[None]).reshape(-1, *a.shape[1:])
        for a, b in zip(first, second, strict=True)
    ]  # fmt: skip


Fields = Callable[[Patch], Field]
