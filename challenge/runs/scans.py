"""A further scan, as a diagnosis proposes it: what is changed against the case's first scan."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from challenge.cases.seeds import log_uniform

Floats = NDArray[np.float64]
DRAWN: dict[str, tuple[float, float]] = {
    "turn_deg": (20.0, 180.0), "tilt_deg": (3.0, 9.0), "shift_mm": (1.0, 4.0),
    "range_mm": (0.5, 2.0), "slower": (0.25, 4.0),
}  # fmt: skip
"""Between which a random scan's change is drawn: what instruments and parts allow."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Change:
    """One scan against the first, in the words of diagnosis.json.

    Attributes
    ----------
    turn_deg : of the part about the sensor's axis
    tilt_deg : of the part about the laser line
    shift_mm : along the laser line
    range_mm : farther from the sensor
    slower : factor on the time between profiles
    """

    turn_deg: float = 0.0
    tilt_deg: float = 0.0
    shift_mm: float = 0.0
    range_mm: float = 0.0
    slower: float = 1.0

    def moved(self, start: Floats, way: Floats, span_mm: float, distance_mm: float) -> Floats:
        """Pose (4, 4) of the first profile, sensor -> part; turns keep the place in view.

        Parameters
        ----------
        start
            Pose that the first scan began with.
        way, span_mm
            Direction of the travel in the sensor's frame, and its length.
        distance_mm
            To the place in view.
        """
        half = way * span_mm / 2
        ahead = np.array([0.0, 0.0, distance_mm])
        place = start[:3, 3] + start[:3, :3] @ (half + ahead)
        # about the sensor's own axes, the turn first
        turn = start[:3, :3] @ (
            Rotation.from_euler("z", self.turn_deg, degrees=True)
            * Rotation.from_euler("x", self.tilt_deg, degrees=True)
        ).as_matrix()
        out = np.eye(4)
        out[:3, :3] = turn
        away = ahead + np.array([-self.shift_mm, 0.0, self.range_mm])
        out[:3, 3] = place - turn @ (half + away)
        return out

    def as_json(self) -> dict[str, float]:
        """Return its fields."""
        return asdict(self)


KEYS = tuple(f.name for f in fields(Change))


def first_proposed(answer: Mapping[str, Any] | None) -> Change | None:
    """Return the first of an answer's ``next_measurements`` that is a scan of this part.

    Others (a certified step) can't be taken here; without any there is none.
    """
    for entry in (answer or {}).get("next_measurements", []):
        wanted = entry.get("change", entry)
        given = {key: float(wanted[key]) for key in KEYS if wanted.get(key) is not None}
        if given and Change(**given) != Change():
            return Change(**given)
    return None


def drawn(rng: np.random.Generator) -> Change:
    """Draw a scan at random: one thing is changed, as far as a user might."""
    key, sign = str(rng.choice(KEYS)), float(rng.choice([-1, 1]))
    low, high = DRAWN[key]
    if key == "slower":
        return Change(slower=log_uniform(rng, low, high))
    return Change(**{key: sign * float(rng.uniform(low, high))})
