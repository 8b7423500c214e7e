"""What good instruments have, as recordings show it: no cause, by how near it comes to one."""

from dataclasses import dataclass

from diagnosis.components.component import Component


@dataclass(frozen=True, kw_only=True, slots=True)
class Habit:
    """A component that a good instrument has as well.

    Attributes
    ----------
    name : of the candidate
    size : whitened rms (mean), or rms of the linear predictor (other channels)
    nats : by how much more probable than nothing it is
    fault : probability that there is a cause in its place, and no good instrument
    repeats : frequency or place of its form, where it has one
    """

    name: str
    component: Component
    size: float
    nats: float
    fault: float
    repeats: float = 0.0
