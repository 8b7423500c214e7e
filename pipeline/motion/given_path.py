"""A path stated in a recipe: waypoints, or a file of recorded poses."""

from pipeline.motion.limits import Motion
from pipeline.motion.recorded_path import replay
from pipeline.motion.trajectory import Array, Trajectory, follow, rate_of
from sensors.datasheet import Datasheet


def given_path(
    motion: Motion, datasheet: Datasheet, profiles: int, part_centre_mm: Array
) -> Trajectory:
    """Return the poses of `motion.path`, which is not None; poses of a file are in the part frame.

    Raises
    ------
    RecipeError
        Where the path ends before the last profile, or its file can't be read.
    """
    if isinstance(motion.path, str):
        return replay(motion.path, rate_of(motion, datasheet), profiles)
    assert motion.path is not None
    return follow(motion.path, motion, datasheet, profiles, part_centre_mm)
