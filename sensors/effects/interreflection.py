"""In concave corners the facing wall's second spot pulls the reading."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from sensors.effects.base import Effect
from sensors.effects.parameter import parameter
from sensors.effects.relaxed import Relaxed
from sensors.law import Law
from sensors.view.view import View

Floats = NDArray[np.float64]

DARK = 50.0
"""Fall of a spot's light, minus its logarithm, beyond which there is none."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Interreflection(Effect):
    """Weighted mean of the spot and its mirror image on the facing wall, or a jump to it.

    Speckle makes the brightness of both spots scatter: what lies between them scatters.
    """

    name: ClassVar = "interreflection"
    summary: ClassVar = (
        "In a concave corner the laser is reflected onto the facing wall; the camera sees two "
        "spots and reads something between, or the wrong one."
    )
    equation: ClassVar = (
        "z_m = (z + ρ z_mirror) / (1 + ρ), ρ = weight · exp(-(d / reach)^power) cos γ₂ / cos γ₁, "
        "γ the camera's angles at both spots; σ² = σ0² + (C ρ (z_mirror - z) / (1 + ρ)²)² (1 + "
        "exp((d / reach)^power)); z_mirror where ρ > 1 with kind 'jump'"
    )
    source: ClassVar = (
        "One mirror bounce, then Lambert's law; Nayar, Ikeuchi, Kanade, Int. J. Comput. Vis. 6 "
        "(1991) 173 on interreflections; observed 1 to 10 mm from corners; first order of a "
        "centre of gravity of two spots whose brightness scatters independently, as the root of "
        "how many places send light"
    )
    statement: ClassVar = (
        "In concave corners light reflected from one wall onto the other distorts the depth, with"
        " a weight of {weight:.3f} near the corner that fades over {reach_mm:.1f} mm."
    )
    channels: ClassVar = ("mean", "variance")
    faint: ClassVar = True
    frame: ClassVar = "part"
    covariate: ClassVar = "wall_distance"
    relaxed: ClassVar = (Relaxed(channel="mean", spanned=True),)
    rivals: ClassVar = ("finite_spot", "form_error", "incidence_bias")
    separating: ClassVar = "spray the part matt: a true fillet stays, a reflection goes"
    needs: ClassVar = ("triangulation_angle_deg",)

    weight: float = parameter(
        "brightness of the second spot at the corner, beside a first one seen as squarely",
        low=0.0,
        high=1.0,
        typical=0.05,
        null=0.0,
        linear=True,
    )
    reach_mm: float = parameter(
        "distance to the facing wall over which the weight falls by e",
        unit="mm",
        low=0.2,
        high=100.0,
        typical=5.0,
        grid=(0.5, 1.2, 3.0, 8.0),
    )
    power: float = parameter(
        "how abruptly it falls; a finder's threshold cuts the second spot off",
        low=0.5,
        high=4.0,
        typical=1.0,
        grid=(1.0, 2.0),
    )
    contrast: float = parameter(
        "relative scatter C of a spot's brightness; the second's grows as that falls",
        low=0.0,
        high=1.0,
        typical=0.2,
        fixed=True,
    )
    kind: str = parameter(
        "centre of gravity of both spots, or the brighter one",
        typical="blend",
        choices=('blend', 'jump'),
    )

    def fields(self, view: View) -> tuple[Floats, ...]:
        """Return the pull of a faint spot for a weight of one: way to its reading, fading."""
        if self.kind == "jump":
            return ()
        pull, light, _ = self._pull(view)
        return (pull * light,)

    def changed(self, law: Law, view: View) -> Law:
        """Mix the second spot's reading in, or put it in the first one's place."""
        pull, light, fallen = self._pull(view)
        share = self.weight * light / (1.0 + self.weight * light)
        if self.kind == "jump":
            share = (share > 0.5).astype(np.float64)
        places = np.sqrt(1.0 + np.exp(fallen))
        scatter = self.contrast * share * (1.0 - share) * pull * places
        return replace(
            law,
            mean_mm=law.mean_mm + share * pull,
            white_sd_mm=np.hypot(law.white_sd_mm, scatter),
        )

    def _pull(self, view: View) -> tuple[Floats, Floats, Floats]:
        """Return the way to the second reading, its light, and minus ln of how far that fell."""
        mirror = view.mirror
        seen = np.isfinite(mirror.landed_mm) & view.valid
        pull = np.where(seen, mirror.landed_mm - view.depth_mm, 0.0)
        way = np.where(seen, mirror.landed_way_mm, 0.0)
        fallen = np.minimum((way / self.reach_mm) ** self.power, DARK)
        light = mirror.landed_light * np.exp(-fallen)
        return pull, np.where(seen, light, 0.0), fallen
