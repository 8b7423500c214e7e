"""Brightness of the laser line in the camera: Lambert and a specular lobe over the part's albedo.

The lobe is Gaussian in the tangent of the angle between normal and half vector, as the facets of a
rough surface are (Beckmann; Torrance and Sparrow, J. Opt. Soc. Am. 57 (1967) 1105).
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from files.record import record
from quantity import quantity
from sensors.effects.effect import Effect
from sensors.effects.light_falloff import LightFalloff
from sensors.effects.specular_dropout import SpecularDropout, returned_light
from sensors.view.view import View

Floats = NDArray[np.float64]

LEVELS: Final = 255
"""Steps of the camera: 8 bits; the last one is saturated."""


@record
class Brightness:
    """How bright the laser line is in the camera's picture.

    A sensor that lists `specular_dropout` has that effect's `matt` and `lobe_deg`, and one that
    lists `light_falloff` that falloff: what is too dark to be read and what is dark in the picture
    are one light.
    """

    exposure: float = quantity(
        "brightness of a white matt surface that faces the laser; 1 saturates",
        low=0, above=True, high=1000, default=0.5,
    )
    matt: float = quantity(
        "share of the diffuse part in the light at the lobe's peak",
        low=1e-3, high=1, default=0.05, source="as typical of `specular_dropout`",
    )
    lobe_deg: float = quantity(
        "width of the specular lobe, as an angle of microfacets",
        unit="°", low=1, high=45, default=8.0, source="as typical of `specular_dropout`",
    )

    def levels(self, view: View) -> NDArray[np.uint8]:
        """Return the camera's levels (n, m), 0 to `LEVELS`, 0 where geometry gives no reading.

        Parameters
        ----------
        view : View
            The scan as it is; needs the camera's place.
        """
        matt, lobe_deg = self._gloss(view.sensor.effects)
        light = returned_light(view, matt, lobe_deg) * (self.exposure / matt)
        for effect in view.sensor.effects:
            if isinstance(effect, LightFalloff):
                light = light * np.exp(effect.log_signal(view))
        with np.errstate(invalid="ignore"):
            lit = light > 0
        level = np.rint(np.minimum(np.where(lit, light, 0.0), 1.0) * LEVELS)
        return np.asarray(level, dtype=np.uint8)

    def _gloss(self, effects: tuple[Effect, ...]) -> tuple[float, float]:
        for effect in effects:
            if isinstance(effect, SpecularDropout):
                return max(effect.matt, 1e-3), effect.lobe_deg
        return self.matt, self.lobe_deg
