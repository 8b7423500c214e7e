"""Limits of the sensor's motion, as stated in a recipe."""

from typing import Annotated

from annotated_types import Len

from files.record import record
from pipeline.distribution_field import Distribution
from quantity import quantity
from quantity.distribution import Choice, Fixed

Vector = tuple[float, float, float]
ZERO = Fixed(value=0.0)
TILT_DEG = 80.0  # a sensor tilted so far still looks at the part


@record
class Waypoint:
    """A position of the sensor's origin, its orientation there and the speed of the leg after."""

    at_mm: Vector
    roll_deg: float = 0.0
    pitch_deg: float = 0.0
    yaw_deg: float = 0.0
    speed_mm_s: float | None = quantity(
        "speed of the leg after; the sensor's where left out",
        unit="mm/s", low=0, above=True, default=None,
    )


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
    own axis, then pitch about x, then roll about y. The middle of the path is aimed at a point
    of the surface: on a flaw with probability `aim_at_flaws`, else at any visible point.
    Path length = profiles * speed / rate: `length_mm` sets the speed, and with both given the
    profiles are triggered by an encoder and the rate follows. A `path` is given by its waypoints,
    or by the name of a file of poses, CSV or HDF5, recorded by a robot. With `cover`, passes
    are planned over the part from all sides, and the scans of a specimen take one after the other.
    """

    look: Vector = (0.0, 0.0, -1.0)
    travel: Vector = (0.0, 1.0, 0.0)
    length_mm: Distribution | None = quantity(
        "length of the path", unit="mm", low=1e-3, high=1e6, default=None
    )
    speed_mm_s: Distribution | None = quantity(
        "speed along the path; the sensor's where left out",
        unit="mm/s", low=1e-3, high=1e6, default=None,
    )
    profile_rate_hz: float | None = quantity(
        "profiles per second; the sensor's where left out",
        unit="Hz", low=0, above=True, default=None,
    )
    standoff_mm: Distribution = quantity(
        "distance beyond the working distance", unit="mm", low=-1e4, high=1e4, default=ZERO
    )
    roll_deg: Distribution = quantity(
        "turn about the travel", unit="°", low=-TILT_DEG, high=TILT_DEG, default=ZERO
    )
    pitch_deg: Distribution = quantity(
        "turn about the laser line", unit="°", low=-TILT_DEG, high=TILT_DEG, default=ZERO
    )
    yaw_deg: Distribution = quantity(
        "turn about the laser's axis", unit="°", low=-360.0, high=360.0, default=ZERO
    )
    direction: Distribution = quantity(
        "1 along the travel, -1 against it", low=-1, high=1, default=Fixed(value=1.0)
    )
    aim_at_flaws: float = quantity(
        "share of the scans that look at a flaw", low=0, high=1, default=0.7
    )
    aim_jitter: float = quantity(
        "distance of an aimed flaw from the scan's middle at most, over half the line's length and "
        "half the path's",
        low=0, high=1, default=0.5,
    )
    least_seen: float = quantity(
        "share of the points in range, over that of a path across the part's middle, below which "
        "a path is drawn again",
        low=0, high=1, default=0.3,
    )
    tries: int = quantity(
        "paths that are drawn at most", low=1, high=1000, whole=True, default=30
    )
    path: WaypointPath | str | None = None
    cover: float | None = quantity(
        "share of the surface that planned passes see together, scan after scan of a specimen; in "
        "place of drawn paths",
        low=0, above=True, high=1, default=None,
    )

    def __post_init__(self) -> None:
        if isinstance(self.path, str) and not self.path.lower().endswith((".csv", ".h5")):
            raise ValueError(f"path: {self.path!r} must be waypoints, or a .csv or .h5 of poses")
        if self.path is not None and self.cover is not None:
            raise ValueError("either 'path' or 'cover'")
        drawn = self.direction
        values = drawn.values if isinstance(drawn, Choice) else {*drawn.limits()}
        if not isinstance(drawn, Choice | Fixed) or not {*values} <= {-1.0, 1.0}:
            raise ValueError(
                f"direction: {self.direction.to_recipe()!r} must be 1, -1 or {{choice: [-1, 1]}}"
            )
