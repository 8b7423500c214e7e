"""In concave corners the facing wall's second spot pulls the reading."""

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
class Interreflection(Effect):
    """Weighted mean of the spot and its mirror image on the facing wall, or a jump to it."""

    name: ClassVar = "interreflection"
    summary: ClassVar = (
        "In a concave corner the laser is reflected onto the facing wall; the camera sees two "
        "spots and reads something between, or the wrong one."
    )
    equation: ClassVar = (
        "z_m = (1-w) z + w z_mirror, w = weight · exp(-(d / reach)^power) cos γ₂ / cos γ₁, γ the "
        "camera's angles at both spots; z_mirror where w > 1/2 with kind 'jump'"
    )
    source: ClassVar = (
        "One mirror bounce, then Lambert's law; Nayar, Ikeuchi, Kanade, Int. J. Comput. Vis. 6 "
        "(1991) 173 on interreflections; observed 1 to 10 mm from corners"
    )
    statement: ClassVar = (
        "In concave corners light reflected from one wall onto the other distorts the depth, with"
        " a weight of {weight:.3f} near the corner that fades over {reach_mm:.1f} mm."
    )
    channels: ClassVar = ("mean",)
    frame: ClassVar = "part"
    covariate: ClassVar = "wall_distance"
    rivals: ClassVar = ("finite_spot", "form_error", "incidence_bias")
    separating: ClassVar = "spray the part matt: a true fillet stays, a reflection goes"
    needs: ClassVar = ("triangulation_angle_deg",)

    weight: float = parameter(
        "weight of the second spot at the corner",
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
    kind: str = parameter(
        "centre of gravity of both spots, or the brighter one",
        typical="blend",
        choices=('blend', 'jump'),
    )

    def fields(self, view: View) -> tuple[Floats, ...]:
        """Return the pull for a weight of one: distance to the mirrored reading, fading."""
        if self.kind == "jump":
            return ()
        pull, light = self._pull(view)
        return (pull * light,)

    def changed(self, law: Law, view: View) -> Law:
        """Mix the second spot's reading in, or put it in the first one's place."""
        pull, light = self._pull(view)
        share = np.minimum(self.weight * light, 1.0)
        if self.kind == "jump":
            share = (share > 0.5).astype(np.float64)
        return replace(law, mean_mm=law.mean_mm + share * pull)

    def _pull(self, view: View) -> tuple[Floats, Floats]:
        mirror = view.mirror
        seen = np.isfinite(mirror.landed_mm) & view.valid
        pull = np.where(seen, mirror.landed_mm - view.depth_mm, 0.0)
        way = np.where(seen, mirror.landed_way_mm, 0.0)
        light = mirror.landed_light * np.exp(-((way / self.reach_mm) ** self.power))
        return pull, np.where(seen, light, 0.0)
