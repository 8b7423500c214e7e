"""Light enters a translucent material and comes back from below its surface."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from sensors.effects.base import Effect
from sensors.effects.parameter import parameter
from sensors.law import Law
from sensors.view import View

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class VolumeScattering(Effect):
    """Readings sink by the mean depth from which light returns, less on oblique surfaces."""

    name: ClassVar = "volume_scattering"
    summary: ClassVar = (
        "Plastics, wax or ceramics let the light in: readings lie below the surface, by an amount"
        " that depends on angle and wall thickness."
    )
    equation: ClassVar = "d (1 - exp(-t/d)) cos βt, sin βt = sin β / n"
    source: ClassVar = (
        "Exponential free path in a slab of thickness t behind the point, ray refracted by "
        "Snell's law; 10 to 300 µm reported for plastics and marble (Godin et al., Proc. SPIE "
        "4298 (2001))"
    )
    statement: ClassVar = (
        "The material is translucent: readings lie about {depth_um:.0f} µm below the surface, "
        "less on oblique or thin walls."
    )
    channels: ClassVar = ("mean",)
    frame: ClassVar = "sensor"
    covariate: ClassVar = "incidence"
    rivals: ClassVar = ("incidence_bias", "pose_error")
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
    index: float = parameter(
        "refractive index n",
        low=1.0,
        high=2.5,
        typical=1.5,
    )

    def fields(self, view: View) -> tuple[Floats, ...]:
        """Return the sinking per µm of free path, exact where the material is thick."""
        return (1e-3 * self._sinking(view),)

    def changed(self, law: Law, view: View) -> Law:
        """Add the sinking to the mean."""
        return replace(law, mean_mm=law.mean_mm + 1e-3 * self.depth_um * self._sinking(view))

    def _sinking(self, view: View) -> Floats:
        sine = np.sin(view.incidence_rad) / self.index
        free = self.depth_um * 1e-3
        thick = np.where(np.isfinite(view.thickness_mm), view.thickness_mm, np.inf)
        filled = -np.expm1(-thick / free) if free > 0 else np.ones(view.shape)
        return np.asarray(filled * np.sqrt(1.0 - np.square(sine)))
