"""A further scan, as a diagnosis proposes it: what is changed against the case's first scan."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]
TURN_DEG, TILT_DEG, SHIFT_MM, SPEED = (20.0, 180.0), (3.0, 9.0), (1.0, 4.0), (0.4, 2.5)
"""Between which a random scan's change is drawn; what instruments and parts allow."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Change:
    """One scan against the first.

    Attributes
    ----------
    turn_deg : of the part about its z, under the sensor
    tilt_deg : of the sensor about the line's and the travel's direction, around the place in view
    shift_mm : of the sensor along its line, and along the travel
    standoff_mm : farther away
    speed : times as fast, at the same pitch
    """

    turn_deg: float = 0.0
    tilt_deg: tuple[float, float] = (0.0, 0.0)
    shift_mm: tuple[float, float] = (0.0, 0.0)
    standoff_mm: float = 0.0
    speed: float = 1.0

    def moved(self, start: Floats, way: Floats, span_mm: float, distance_mm: float) -> Floats:
        """Pose (4, 4) of the first profile, sensor -> part.

        Parameters
        ----------
        start
            Pose that the first scan began with.
        way, span_mm
            Direction of the travel in the sensor's frame, and its length.
        distance_mm
            To the place in view.
        """
        middle = start.copy()
        middle[:3, 3] += start[:3, :3] @ way * span_mm / 2
        place = middle[:3, 3] + middle[:3, 2] * distance_mm
        spin = Rotation.from_euler("z", -self.turn_deg, degrees=True).as_matrix()
        lean = Rotation.from_euler("xy", self.tilt_deg, degrees=True).as_matrix()
        turn = spin @ start[:3, :3] @ lean
        out = np.eye(4)
        out[:3, :3] = turn
        aside = np.array([self.shift_mm[0], 0.0, 0.0]) + self.shift_mm[1] * way
        away = np.array([0.0, 0.0, distance_mm + self.standoff_mm])
        out[:3, 3] = place + turn @ (aside - away) - turn @ way * span_mm / 2
        return out


KEYS = ("turn_deg", "tilt_deg", "shift_mm", "standoff_mm", "speed")


def first_proposed(answer: Mapping[str, Any] | None) -> Change | None:
    """Return the first of an answer's ``next_measurements`` that is a scan of this part.

    Others (a certified step, a repeat when warm) can't be taken here; without any there is none.

    Raises
    ------
    ValueError
        Where a scan changes something that the instrument here can't.
    """
    for entry in (answer or {}).get("next_measurements", []):
        wanted = entry.get("change", entry)
        changes = {key: wanted[key] for key in KEYS if wanted.get(key) is not None}
        if changes:
            return of(changes)
    return None


def of(changes: Mapping[str, Any]) -> Change:
    """Read a scan from plain numbers; a shift or tilt may be one number or two."""
    kept: dict[str, Any] = {}
    for key, value in changes.items():
        if key in ("tilt_deg", "shift_mm"):
            two = value if isinstance(value, Sequence) else (value, 0.0)
            if len(two) != 2:
                raise ValueError(f"{key}: one number or two; value {value!r}")
            kept[key] = (float(two[0]), float(two[1]))
        else:
            kept[key] = float(value)
    return Change(**kept)


def drawn(rng: np.random.Generator) -> Change:
    """Draw a scan at random: one thing is changed, as far as a user might."""
    kind, sign = str(rng.choice(["turn_deg", "tilt_deg", "shift_mm", "speed"])), rng.choice([-1, 1])
    if kind == "turn_deg":
        return Change(turn_deg=float(sign * rng.uniform(*TURN_DEG)))
    if kind == "speed":
        return Change(speed=float(np.exp(rng.uniform(*np.log(SPEED)))))
    angle = rng.uniform(0, 2 * np.pi)
    low, high = TILT_DEG if kind == "tilt_deg" else SHIFT_MM
    size = rng.uniform(low, high)
    return of({kind: [float(size * np.cos(angle)), float(size * np.sin(angle))]})
