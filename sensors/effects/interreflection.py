"""Bias in concave corners by a second spot on the facing wall."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from sensors.effects.effect import Effect
from sensors.effects.parameter import parameter
from sensors.effects.relaxed import Relaxed
from sensors.law import Law
from sensors.view.view import View

Floats = NDArray[np.float64]

DARK = 50.0
"""Negative logarithm of a spot's light beyond which the light is zero."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Interreflection(Effect):
    """Weighted mean of the spot and its mirror image on the facing wall, or the image alone.

    Speckle scatters the brightness of both spots, and with it their weighted mean.
    """

    name: ClassVar = "interreflection"
    summary: ClassVar = (
        "In a concave corner the laser is reflected onto the facing wall. The camera sees two "
        "spots and reads a depth between them, or that of the second."
    )
    equation: ClassVar = (
        "z_m = (z + ρ z_mirror) / (1 + ρ), ρ = weight · exp(-(d / reach)^power) cos γ₂ / cos γ₁, "
        "γ the camera's angles at both spots; σ² = σ0² + (C ρ (z_mirror - z) / (1 + ρ)²)² (1 + "
        "exp((d / reach)^power)); z_mirror where ρ > 1 with kind 'jump'"
    )
    source: ClassVar = (
        "One mirror bounce, then Lambert's law; Nayar, Ikeuchi, Kanade, Int. J. Comput. Vis. 6 "
        "(1991) 173 on interreflections; observed 1 to 10 mm from corners; first order of the "
        "centroid of two spots whose brightness scatters independently, as the root of the number "
        "of places that send light"
    )
    statement: ClassVar = (
        "In concave corners, light reflected from one wall onto the other biases the depth, with"
        " a weight of {weight:.3f} at the corner that decays over {reach_mm:.1f} mm."
    )
    channels: ClassVar = ("mean", "variance")
    first_order: ClassVar = True
    frame: ClassVar = "part"
    covariate: ClassVar = "wall_distance"
    relaxed: ClassVar = (Relaxed(channel="mean", spanned=True),)
    rivals: ClassVar = ("finite_spot", "form_error", "incidence_bias")
    separating: ClassVar = "spray the part matt: a true fillet stays, a reflection vanishes"
    needs: ClassVar = ("triangulation_angle_deg",)

    weight: float = parameter(
        "brightness of the second spot at the corner, over that of the first at the same angle",
        low=0.0,
        high=1.0,
        typical=0.05,
        null=0.0,
        linear=True,
    )
    reach_mm: float = parameter(
        "distance to the facing wall over which the weight falls by a factor e",
        unit="mm",
        low=0.2,
        high=100.0,
        typical=5.0,
        grid=(0.5, 1.2, 3.0, 8.0),
    )
    power: float = parameter(
        "power of the decay; a peak finder's threshold makes the decay abrupt",
        low=0.5,
        high=4.0,
        typical=1.0,
        grid=(1.0, 2.0),
    )
    contrast: float = parameter(
        "relative scatter C of a spot's brightness; that of the second grows as its light decays",
        low=0.0,
        high=1.0,
        typical=0.2,
        fixed=True,
    )
    kind: str = parameter(
        "blend: centroid of both spots; jump: the brighter spot",
        typical="blend",
        choices=("blend", "jump"),
    )

    def fields(self, view: View) -> tuple[Floats, ...]:
        """Return the bias by a faint spot of unit weight: distance to its reading, decaying."""
        if self.kind == "jump":
            return ()
        pull, light, _ = self._pull(view)
        return (pull * light,)

    def changed(self, law: Law, view: View) -> Law:
        """Mix the readings of both spots, or take that of the second."""
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
        """Return the distance to the second reading, its light, and minus the log of the decay."""
        mirror = view.mirror
        seen = np.isfinite(mirror.landed_mm) & view.in_range
        pull = np.where(seen, mirror.landed_mm - view.depth_mm, 0.0)
        way = np.where(seen, mirror.landed_way_mm, 0.0)
        fallen = np.minimum((way / self.reach_mm) ** self.power, DARK)
        light = mirror.landed_light * np.exp(-fallen)
        return pull, np.where(seen, light, 0.0), fallen
