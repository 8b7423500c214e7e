"""Subsurface scattering: light enters a translucent material and returns from below."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from sensors.effects.effect import Effect
from sensors.effects.parameter import parameter
from sensors.effects.relaxed import Relaxed
from sensors.law import Law
from sensors.line.line_operator import line_mean, line_sd_mm
from sensors.view.view import View

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class VolumeScattering(Effect):
    """Bias by the mean apparent depth from which light returns.

    The laser is refracted at the surface and travels the mean free path d. Seen through the
    surface, the path's component along the normal appears shorter by the factor n. A unit of path
    is displaced by

        q = (l + (cos β - cos βt) N) / n,   sin βt = sin β / n

    with l the laser's direction and N the outward normal. A displacement out
    of the laser's plane changes the triangulated depth, so the bias depends on the slope along the
    travel. A displacement within that plane moves the light to another column: a slope p_x along
    the line is read e = q_x - q_z tan a beside the column's line, which lies at the angle a. Where
    the line's width is known, the bias is the mean over the width: faces may meet within the line.

    Light from many depths averages speckle. The lit volume also differs from place to place with
    the material's grain: the noise of marble is several times that of a surface (Godin et al.).
    """

    name: ClassVar = "volume_scattering"
    summary: ClassVar = (
        "Light penetrates plastics, wax or ceramics: readings lie below the surface, by an amount"
        " that depends on incidence and wall thickness."
    )
    equation: ClassVar = (
        "d (1 - exp(-t/d)) (q_z + q_y z / b - e p_x / (1 - p_x tan a)), "
        "q = (l + (cos β - cos βt) N) / n, e = q_x - q_z tan a"
    )
    source: ClassVar = (
        "Exponential free path in a slab of thickness t behind the point, Snell's law on the way "
        "in, apparent depth (paraxial) on the way out, triangulated by a camera at b; 10 to 300 µm "
        "reported for plastics and marble (Godin et al., Proc. SPIE 4298 (2001))"
    )
    statement: ClassVar = (
        "The material is translucent, with a mean free path of {depth_um:.0f} µm: readings lie "
        "below the surface, by an amount that depends on slope and wall thickness."
    )
    channels: ClassVar = ("mean", "variance")
    frame: ClassVar = "sensor"
    covariate: ClassVar = "incidence"
    relaxed: ClassVar = (Relaxed(channel="mean", along=("incidence",)),)
    rivals: ClassVar = ("incidence_bias", "pose_error")
    goes_by: ClassVar = ("triangulation_angle_deg",)
    separating: ClassVar = (
        "scan an opaque reference beside the part, or the part with an opaque coat"
    )

    depth_um: float = parameter(
        "mean free path d",
        unit="µm",
        low=0.0,
        high=1000.0,
        typical=80.0,
        null=0.0,
        linear=True,
        grid=(20.0, 80.0, 300.0),
    )
    grain: float = parameter(
        "factor on the speckle, which light from many depths averages and the material's grain "
        "adds to",
        low=0.05,
        high=10.0,
        typical=1.0,
    )
    index: float = parameter(
        "refractive index n",
        low=1.0,
        high=2.5,
        typical=1.5,
        fixed=True,
    )

    def fields(self, view: View) -> tuple[Floats, ...]:
        """Return the bias per µm of free path, exact where the material is thick."""
        return (1e-3 * self._sinking(view),)

    def changed(self, law: Law, view: View) -> Law:
        """Add the bias to the mean, and average the speckle."""
        return replace(
            law,
            mean_mm=law.mean_mm + 1e-3 * self.depth_um * self._sinking(view),
            speckle_gain=law.speckle_gain * self.grain,
        )

    def _sinking(self, view: View) -> Floats:
        free = self.depth_um * 1e-3
        thick = np.where(np.isfinite(view.thickness_mm), view.thickness_mm, np.inf)
        filled = -np.expm1(-thick / free) if free > 0 else np.ones(view.shape)
        if view.datasheet.line_width_um is None:
            return np.asarray(filled * self._thick(view))
        return np.asarray(filled * line_mean(view, line_sd_mm(view, None, None), self._thick))

    def _thick(self, view: View) -> Floats:
        """Bias per unit of free path in a part that is thick everywhere."""
        cosine = view.cos_incidence
        bent = cosine - np.sqrt(1.0 - (1.0 - np.square(cosine)) / self.index**2)
        sunk = view.ray[:, 2] + bent * view.normal[..., 2]
        # the ray itself keeps to its column
        beside = bent * (view.normal[..., 0] - view.laser.slope_x * view.normal[..., 2])
        sunk = sunk - beside * _slope_between_columns(view)
        if view.datasheet.triangulation_angle_deg is not None:
            aside = view.ray[:, 1] + bent * view.normal[..., 1]
            sunk = sunk + aside * view.depth_mm / view.datasheet.camera_offset_mm
        return np.asarray(sunk / self.index)


def _slope_between_columns(view: View) -> Floats:
    """Return the change of depth with the distance from a column's line, (n, m), sensor frame.

    The smallest of the facet's slope and the slopes to both neighbours; zero where their signs
    differ. Light enters through the facet that is hit only where the facet is wider than a pixel.
    """
    slope, line, depth = view.slope_x, view.laser.slope_x, view.depth_mm
    pitch = np.diff(view.laser.x_mm) + np.diff(line) * 0.5 * (depth[:, 1:] + depth[:, :-1])
    between = np.pad(np.diff(depth, axis=1) / pitch, ((0, 0), (1, 1)), constant_values=np.nan)
    three = (slope / (1.0 - slope * line), between[:, 1:], between[:, :-1])
    least, most = np.fmin.reduce(three), np.fmax.reduce(three)
    return np.asarray(np.where(least > 0, least, np.minimum(most, 0.0)))
