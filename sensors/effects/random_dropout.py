"""Random dropout: readings are missing one by one or in patches."""

from dataclasses import dataclass, replace
from typing import ClassVar

from sensors.effects.effect import Effect
from sensors.effects.parameter import parameter
from sensors.effects.relaxed import Relaxed
from sensors.law import Law
from sensors.view.view import View


@dataclass(frozen=True, kw_only=True, slots=True)
class RandomDropout(Effect):
    """A constant probability of a missing reading."""

    name: ClassVar = "random_dropout"
    summary: ClassVar = "Readings are missing at random, independent of geometry."
    equation: ClassVar = "p_missing = 1 - (1 - p_missing)(1 - share)"
    source: ClassVar = "Bernoulli trials; patches by a thresholded Gaussian field"
    statement: ClassVar = "{share:.2%} of the readings are missing at random."
    channels: ClassVar = ("missing",)
    frame: ClassVar = "sensor"
    covariate: ClassVar = "time"
    relaxed: ClassVar = (Relaxed(channel="missing", grows=True),)
    rivals: ClassVar = ("specular_dropout", "camera_occlusion")
    separating: ClassVar = (
        "repeat the scan: random dropouts move, dropouts by specular lobes and shadows stay"
    )

    share: float = parameter(
        "probability that a reading is missing",
        low=0.0,
        high=0.9,
        typical=0.01,
        null=0.0,
        grid=(0.002, 0.01, 0.05),
    )
    patch_mm: float = parameter(
        "size of the patches of missing readings; 0: single readings",
        unit="mm",
        low=0.0,
        high=50.0,
        typical=0.0,
    )

    def changed(self, law: Law, view: View) -> Law:
        """Add the probability; of several effects the largest patch size holds."""
        lost = law.losing(self.share)
        return replace(lost, missing_patch_mm=max(law.missing_patch_mm, self.patch_mm))
