"""A filter of the firmware that recordings went through."""

from collections.abc import Collection
from dataclasses import dataclass

from sensors.effects.onboard_filter import OnboardFilter


@dataclass(frozen=True, kw_only=True, slots=True)
class Filtered:
    """A filter that noise told of.

    Attributes
    ----------
    effect : as it is expected in the recordings; of unknown form, the nearest known one
    probability : that there is one
    unknown : probability that its form is none of the known ones, if there is one
    """

    effect: OnboardFilter
    probability: float
    unknown: float

    def unpredicted(self, channels: Collection[str]) -> float:
        """Probability that it changes readings of some channels otherwise than is expected.

        One of unknown form does in each. On slopes a median leaves more noise, and noise of another
        spectrum, than on flats, which the model of the noise doesn't have.
        """
        if "scale" in channels and self.effect.median_window != (1, 1):
            return self.probability
        return self.probability * self.unknown
