"""Form error: the part deviates from its CAD model, smoothly or by fillets in concave corners."""

import math
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from files.errors import RecipeError
from sensors.effects.base import AdditiveEffect
from sensors.effects.effect import Effect
from sensors.effects.parameter import Parameter, parameter
from sensors.effects.relaxed import Relaxed
from sensors.law import Law
from sensors.view.covariates import raised_along
from sensors.view.creases import filled_mm
from sensors.view.view import View

Floats = NDArray[np.float64]

MOST = 6.0
"""Largest change of depth over the displacement: about that at 80° of incidence."""
PLACES = 48
"""Points along each side at which the form's rms is evaluated."""


def orders(count: int) -> list[tuple[int, int]]:
    """Return the first `count` pairs (i, j) by rising i + j, then i, without (0, 0)."""
    pairs = [(i, total - i) for total in range(1, count + 2) for i in range(total + 1)]
    return pairs[:count]


@dataclass(frozen=True, kw_only=True, slots=True)
class FormError(AdditiveEffect):
    """Low orders of a cosine series over the part's two longest sides, along the shortest.

    A warped part bends out of its two longest sides, and its walls move with the bend. In addition,
    concave corners that are sharp in the model may have a radius.
    """

    name: ClassVar = "form_error"
    summary: ClassVar = (
        "The part is warped, or its concave corners are rounded: its surface deviates from the "
        "model, and the deviation moves with the part."
    )
    equation: ClassVar = (
        "h = Σ c_ij cos(iπu) cos(jπv) along the shortest side w; δz = h (n·w) / (n·d); a fillet "
        "of radius r fills corners up to t = r tan(τ/2) from the crease"
    )
    source: ClassVar = (
        "Cosine series of low order over the bounding box; 10 to 500 µm; not identifiable from a "
        "single pose beside the instrument's errors. Fillets: plane geometry, τ between the "
        "faces' normals"
    )
    statement: ClassVar = "The part deviates from its model: {form}."
    channels: ClassVar = ("mean",)
    frame: ClassVar = "part"
    covariate: ClassVar = "part_x"
    relaxed: ClassVar = (
        Relaxed(channel="mean", along=("part_x", "part_y", "part_z"), times="raised"),
        Relaxed(channel="mean", spanned=True),
    )
    rivals: ClassVar = ("line_bow", "lens_distortion", "incidence_bias", "stage_vibration")
    separating: ClassVar = (
        "shift or turn the part under the sensor: its form moves with the part, the instrument's "
        "errors do not"
    )

    coefficients_um: tuple[float, ...] = parameter(
        "c_ij by rising order i + j, then i: c01, c10, c02, c11, c20, ...",
        unit="µm",
        low=-20000.0,
        high=20000.0,
        typical=(0.0, 0.0, 40.0, 20.0, -40.0),
        null=0.0,
        linear=True,
        kind="list",
    )
    fillet_mm: float = parameter(
        "radius r of concave corners that are sharp in the model; `coefficients_um: []` states a "
        "fillet without waves",
        unit="mm",
        low=0.0,
        high=50.0,
        typical=0.0,
        null=0.0,
        grid=(0.8, 2.0, 5.0),
    )
    corners_mm: tuple[float, ...] = parameter(
        "points x, y, z of the part, one on each rounded concave crease; empty: all creases",
        unit="mm",
        low=-1e5,
        high=1e5,
        typical=(),
        kind="list",
    )

    def __post_init__(self) -> None:
        Effect.__post_init__(self)
        if len(self.corners_mm) % 3:
            raise RecipeError(
                "corners_mm of effect form_error", value=self.corners_mm, allowed="x, y, z of each"
            )

    def searched(self, *, linear: bool | None = None) -> tuple[Parameter, ...]:
        """Return the radius where it is set: beside waves no radius is searched."""
        found = Effect.searched(self, linear=linear)
        return tuple(p for p in found if p.name != "fillet_mm" or self.fillet_mm > 0)

    def starts(self, view: View) -> tuple[Self, ...]:
        """Return waves of zero, up to the second, fourth, sixth and eighth order; no fillet."""
        return tuple(self.with_parameters(coefficients_um=(0.0,) * n) for n in (5, 14, 27, 44))

    def words(self) -> dict[str, str]:
        """Return the form for the statement."""
        parts = []
        if any(self.coefficients_um):
            parts.append(f"smoothly, by {self.bent_um():.0f} µm rms beyond a tilt")
        if self.fillet_mm > 0:
            where = f", in {len(self.corners_mm) // 3} places" if self.corners_mm else ""
            parts.append(f"concave corners are rounded to {self.fillet_mm:.2g} mm{where}")
        return {"form": "; ".join(parts)}

    def bent_um(self) -> float:
        """Return the rms of the waves over the part's two longest sides, beyond a plane, µm.

        Single waves may be much larger: low ones turn the part, and others turn it back.
        """
        place = (np.arange(PLACES) + 0.5) / PLACES
        u, v = (field.ravel() for field in np.meshgrid(place, place, indexing="ij"))
        waves = _waves(len(self.coefficients_um), u, v)
        height = sum((c * w for c, w in zip(self.coefficients_um, waves, strict=True)), 0.0 * u)
        plane = np.stack([u, v, np.ones(u.size)], axis=1)
        left = height - plane @ np.linalg.lstsq(plane, height, rcond=None)[0]
        return float(np.sqrt(np.mean(left**2)))

    def changed(self, law: Law, view: View) -> Law:
        """Add the waves; a fillet brings the surface nearer."""
        law = AdditiveEffect.changed(self, law, view)
        if self.fillet_mm == 0:
            return law
        filled, _ = filled_mm(view, self.fillet_mm, self.corners_mm)
        return replace(law, mean_mm=law.mean_mm - filled)

    def fields(self, view: View) -> tuple[Floats, ...]:
        """Return each wave's change of depth."""
        low, high = view.scene.vertices_mm.min(axis=0), view.scene.vertices_mm.max(axis=0)
        *long, thin = np.argsort(low - high, kind="stable")
        u, v = ((view.part_mm[..., a] - low[a]) / (high[a] - low[a]) for a in sorted(long))
        raised = raised_along(view, int(thin), most=MOST, by=1e-3)
        return _waves(len(self.coefficients_um), u, v, raised)


def _waves(count: int, u: Floats, v: Floats, size: Floats | float = 1.0) -> tuple[Floats, ...]:
    """Return the first `count` waves of a size, each as large as u, v (shares of the sides)."""
    pairs = orders(count)
    along_u = {i: size * np.cos(i * math.pi * u) for i in {i for i, _ in pairs}}
    along_v = {j: np.cos(j * math.pi * v) for j in {j for _, j in pairs}}
    return tuple(along_u[i] * along_v[j] for i, j in pairs)
