"""Components of the mean: columns that each cause adds, from its relaxed form alone."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from diagnosis.components.row_periods import image_row, strongest_rows
from diagnosis.components.smooth import Ranges, periodic_columns, products, smooth_columns
from diagnosis.fields import Field, Single
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.predict.cameras import needs_of, possible_views
from diagnosis.predict.prediction import law_of
from diagnosis.settings import SETTINGS
from files.errors import RecipeError
from sensors.effects import CATALOGUE
from sensors.effects.base import Effect
from sensors.effects.relaxed import Relaxed, RelaxedChannel
from sensors.view.covariates import COVARIATES
from sensors.view.view import View
from sensors.view.view_cache import ViewCache

if TYPE_CHECKING:
    from diagnosis.data.patch import Patch
    from diagnosis.model.log_density import Whitened

Floats = Field | Single
_CHANGES: ViewCache[Sequence[Floats] | None] = ViewCache(16)


@dataclass(frozen=True, kw_only=True, slots=True)
class Component:
    """One component: a cause's, or one that no cause claims.

    Attributes
    ----------
    name : unique
    effect : the effect's name; "" for unknown physics
    relaxed : its form
    own : whether each recording has its own coefficients
    placement : numbers of the placement that it leaves free
    pitch : periods over the working range, of a periodic component
    """

    name: str
    effect: str
    relaxed: Relaxed
    own: bool = False
    pitch: float = 0.0
    placement: tuple[int, ...] = ()

    @property
    def group(self) -> str:
        """Name of the component whose variants differ in pitch alone."""
        return self.name.partition(" at ")[0]

    @property
    def is_curve(self) -> bool:
        """Whether its values hold for other recordings, too, and follow no law at edges."""
        own = self.own or self.relaxed.each == "profile"
        return self.relaxed.channel == "mean" and not own and not self.relaxed.spanned


RATES: tuple[tuple[RelaxedChannel, str], ...] = (
    ("scale", "noise"), ("missing", "losses"), ("outliers", "outliers"),
)  # fmt: skip
TRAVEL = (6, 7, 8)
"""Numbers of a placement that say how the sensor travels: length and direction."""
UNKNOWN: tuple[Component, ...] = (
    Component(name="map of the scan", effect="", own=True,
              relaxed=Relaxed(channel="mean", along=("travel", "x"))),
    Component(name="travel's length and direction", effect="", own=True, placement=TRAVEL,
              relaxed=Relaxed(channel="mean")),
    *(Component(name=f"{word} of profiles", effect="", relaxed=Relaxed(channel=c, each="profile"))
      for c, word in RATES),
    *(Component(name=f"{word} of columns", effect="", relaxed=Relaxed(channel=c, each="column"))
      for c, word in RATES),
    Component(name="noise over the part", effect="",
              relaxed=Relaxed(channel="scale", along=("part_x", "part_y", "part_z"))),
    *(Component(name=f"{word} over line and range", effect="",
                relaxed=Relaxed(channel=c, along=("x", "depth")))
      for c, word in RATES),
)  # fmt: skip


def components_of(channel: str) -> tuple[Component, ...]:
    """Return all components of a channel, catalogued and unknown."""
    known = []
    for name, kind in CATALOGUE.items():
        forms = [r for r in kind.relaxed if r.channel == channel]
        for k, relaxed in enumerate(forms):
            known.append(
                Component(name=name if k == 0 else f"{name} ({k + 1})", effect=name,
                          relaxed=relaxed)
            )  # fmt: skip
    return (*known, *(u for u in UNKNOWN if u.relaxed.channel == channel))


def laws_stated(listed: Iterable[Effect]) -> str:
    """Tell how a file states laws of light at edges: what is weighed is beyond that then.

    Returns
    -------
    "" where it lists none; "listed" where it leaves nothing of one of them to its default, as after
    measurements; else "nominal"
    """
    laws = [e for e in listed if any(r.spanned and r.channel == "mean" for r in e.relaxed)]
    if not laws:
        return ""
    in_full = any(all(getattr(e, f.name) != f.default for f in fields(e)) for e in laws)
    return "listed" if in_full else "nominal"


def stated(key: str, how: str) -> str:
    """Return a component's name with how the sensor's file states it: "listed", "nominal", ""."""
    return f"{key} ({how})" if how else key


def unlisted(key: str) -> str:
    """Return a component's name without how the sensor's file states it."""
    return key.removesuffix(stated("", "listed")).removesuffix(stated("", "nominal"))


def with_pitches(
    components: Sequence[Component], patches: Sequence["Patch"], states: Sequence["Whitened"]
) -> tuple[Component, ...]:
    """Give periodic components the pitches at which the readings ripple most."""
    masks = [~p.edge for p in patches]
    out: list[Component] = []
    for c in components:
        if c.relaxed.periodic and not c.relaxed.each:
            for pitch in strongest_rows(patches, states, masks, SETTINGS.pitches):
                out.append(replace(c, name=f"{c.name} at {pitch:.4g}", pitch=pitch))
        else:
            out.append(c)
    return tuple(out)


def mean_columns(
    component: Component, patch: "Patch", ranges: Ranges, noise: NoiseModel | None = None
) -> Sequence[Floats] | None:
    """Columns of a component on a patch, mm, (n, m) when broadcast; None where it can't act."""
    if component.placement:
        return [patch.columns[..., k] for k in component.placement]
    if component.relaxed.spanned:
        return _spanned(CATALOGUE[component.effect], patch, noise)
    return curve_columns(component, patch.view, ranges)


def curve_columns(component: Component, view: View, ranges: Ranges) -> Sequence[Floats] | None:
    """Columns of a component that is a curve of covariates, mm; None where it can't act."""
    relaxed = component.relaxed
    if relaxed.periodic and not relaxed.each:
        row = np.nan_to_num(image_row(view.depth_mm, view.datasheet))
        return periodic_columns(component.pitch * row, SETTINGS.harmonics)
    axes = axes_of(relaxed, ranges)
    if not axes:
        return None
    values = [COVARIATES[a].values(view) for a in axes]
    columns = smooth_columns(values, [ranges[a] for a in axes], even=relaxed.even)
    if relaxed.times:
        factor = np.nan_to_num(COVARIATES[relaxed.times].values(view))
        columns = [factor * c for c in [np.ones(()), *columns]]
    return columns


def count_of(component: Component, patch: "Patch", ranges: Ranges, noise: NoiseModel) -> int:
    """Count the mean's columns of a component on a patch; 0 where it can't act there."""
    relaxed = component.relaxed
    if component.placement:
        return len(component.placement)
    if relaxed.periodic:
        return 2 * SETTINGS.harmonics
    if relaxed.spanned:
        return len(_spanned(CATALOGUE[component.effect], patch, noise) or ())
    axes = axes_of(relaxed, ranges)
    return (len(products(len(axes), even=relaxed.even)) + bool(relaxed.times)) if axes else 0


def plain_columns(component: Component, patch: "Patch", ranges: Ranges) -> Sequence[Floats] | None:
    """Columns (n, m) of a component of scale, missing or outliers; None where it can't act."""
    relaxed, view = component.relaxed, patch.view
    if not relaxed.along:
        return [np.ones(view.shape)]
    axes = axes_of(relaxed, ranges)
    if not axes:
        return None
    values = [np.broadcast_to(COVARIATES[a].values(view), view.shape) for a in axes]
    return smooth_columns(values, [ranges[a] for a in axes], even=relaxed.even)


def cell_of(component: Component, patch: "Patch", ranges: Ranges) -> NDArray[np.int64]:
    """Cell of each reading (n, m) in a grid over the component's covariates."""
    out = np.zeros(patch.shape, dtype=np.int64)
    for axis in axes_of(component.relaxed, ranges):
        low, high = ranges[axis]
        value = np.broadcast_to(COVARIATES[axis].values(patch.view), patch.shape)
        u = (np.nan_to_num(value, nan=0.5 * (low + high)) - low) / (high - low)
        cell = np.clip((SETTINGS.cells * u).astype(np.int64), 0, SETTINGS.cells - 1)
        out = out * SETTINGS.cells + cell
    return out


def missing_columns(component: Component, patch: "Patch") -> Sequence[Floats]:
    """Share of readings that the law loses at each point of its grid, 0 to 1."""
    kind, view = CATALOGUE[component.effect], patch.view
    before = law_of(view, (), None)
    out = []
    words = [p for p in kind.parameters() if len(p.choices) > 1]
    for point in kind.example().grid(view):
        variants = [point.with_parameters({p.name: c}) for p in words for c in p.choices] or [point]
        for variant in variants:
            after = law_of(view, (variant,), None)
            lost = np.clip(np.asarray(after.p_missing) - before.p_missing, 0, 1)
            gone = np.isfinite(before.mean_mm) & ~np.isfinite(after.mean_mm)
            out.append(np.where(gone, 1.0, np.broadcast_to(lost, view.shape)))
    return out


def axes_of(relaxed: Relaxed, ranges: Ranges) -> list[str]:
    """Covariates that a form's smooth function is of: of a part's three, its two longest sides."""
    axes = [a for a in relaxed.along if a in ranges]
    if len(axes) < len(relaxed.along):
        return []
    if len(axes) > 2:  # a part's two longest sides
        axes = sorted(axes, key=lambda a: ranges[a][0] - ranges[a][1])[:2]
    return axes


def _spanned(
    kind: type[Effect], patch: "Patch", noise: NoiseModel | None
) -> Sequence[Floats] | None:
    """Change of the mean by the law at points of its grid, in all cameras; kept with the view."""
    key = kind.name, None if noise is None else noise.sd_mm
    return _CHANGES.get(patch.view, key, lambda: _changes(kind, patch, noise))


def _changes(
    kind: type[Effect], patch: "Patch", noise: NoiseModel | None
) -> Sequence[Floats] | None:
    out = []
    for view in possible_views(patch.view, needs_of(kind, patch.view.datasheet)):
        try:
            plain = law_of(view, (), noise).mean_mm
            points = kind.none().grid(view)
            if all(p.is_null for p in points):
                points = kind.example().grid(view)
            for point in dict.fromkeys((points[0], points[len(points) // 2], points[-1])):
                change = law_of(view, (point,), noise).mean_mm - plain
                out.append(np.nan_to_num(change).astype(np.float32))
        except (RecipeError, TypeError):
            continue
    return out or None


def seen_by_cameras(component: Component, patches: Sequence["Patch"]) -> list[list["Patch"]]:
    """Look at patches by each camera that a component's covariates may be seen by."""
    needs = [key for a in component.relaxed.along for key in COVARIATES[a].needs]
    views = [possible_views(p.view, needs) for p in patches]
    return [
        [replace(p, view=v) for p, v in zip(patches, picked, strict=True)]
        for picked in zip(*views, strict=True)
    ]
