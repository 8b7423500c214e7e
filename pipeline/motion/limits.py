"""How the sensor may move, as a recipe says it."""

from typing import Annotated, Final

from annotated_types import Ge, Gt, Le, Len

from defects.sizes import Choice, Fixed
from pipeline.size_field import Size
from sensors.typed_yaml import record

Vector = tuple[float, float, float]
ZERO = Fixed(value=0.0)
# A tilted sensor still looks at the part; millimetres and degrees.
LIMITS: Final = {
    "length_mm": (1e-3, 1e6),
    "speed_mm_s": (1e-3, 1e6),
    "standoff_mm": (-1e4, 1e4),
    "roll_deg": (-80.0, 80.0),
    "pitch_deg": (-80.0, 80.0),
    "yaw_deg": (-360.0, 360.0),
}


@record
class Waypoint:
    """A position of the sensor's origin, its orientation there and the speed of the leg after."""

    at_mm: Vector
    roll_deg: float = 0.0
    pitch_deg: float = 0.0
    yaw_deg: float = 0.0
    speed_mm_s: Annotated[float, Gt(0)] | None = None


@record
class WaypointPath:
    """A path that the recipe gives: legs from waypoint to waypoint."""

    waypoints: Annotated[tuple[Waypoint, ...], Len(2)]
    relative_to: str = "part_frame"

    def __post_init__(self) -> None:
        if self.relative_to not in ("part_frame", "part_centre"):
            raise ValueError("'part_frame' or 'part_centre'")


@record
class Motion:
    """Limits of the sensor's path; every number may be a distribution.

    The sensor looks along `look` (part frame) and travels along `travel`, turned by yaw about its
    own axis, then pitch about x, then roll about y. The middle of the path looks at a point of
    the surface: of a flaw with probability `aim_at_flaws`, else anywhere on what can be seen.
    Path length = profiles * speed / rate: `length_mm` sets the speed, and with both given the
    profiles are triggered by an encoder and the rate follows.
    """

    look: Vector = (0.0, 0.0, -1.0)
    travel: Vector = (0.0, 1.0, 0.0)
    length_mm: Size | None = None
    speed_mm_s: Size | None = None
    profile_rate_hz: Annotated[float, Gt(0)] | None = None
    standoff_mm: Size = ZERO
    roll_deg: Size = ZERO
    pitch_deg: Size = ZERO
    yaw_deg: Size = ZERO
    direction: Size = Fixed(value=1.0)
    aim_at_flaws: Annotated[float, Ge(0), Le(1)] = 0.7
    aim_jitter: Annotated[float, Ge(0), Le(1)] = 0.5
    least_seen: Annotated[float, Ge(0), Le(1)] = 0.3
    tries: Annotated[int, Ge(1), Le(1000)] = 30
    path: WaypointPath | None = None

    def __post_init__(self) -> None:
        for name, (low, high) in LIMITS.items():
            size = getattr(self, name)
            if size is not None and not low <= min(size.limits()) <= max(size.limits()) <= high:
                raise ValueError(
                    f"{name}: {size.to_recipe()!r} must stay within {low:g} to {high:g}"
                )
        drawn = self.direction
        values = drawn.values if isinstance(drawn, Choice) else {*drawn.limits()}
        if not isinstance(drawn, Choice | Fixed) or not {*values} <= {-1.0, 1.0}:
            raise ValueError(
                f"direction: {self.direction.to_recipe()!r} must be 1, -1 or {{choice: [-1, 1]}}"
            )
