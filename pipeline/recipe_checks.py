"""What a recipe's keys must agree in with each other, with its sensor, and with what is installed.

Each check raises a `RecipeError` with the place of the key.
"""

import importlib.util
from typing import TYPE_CHECKING, Final

import numpy as np

from files.errors import RecipeError
from files.yaml_document import Document
from pipeline.dataset.compression import reader_needs
from pipeline.motion.given_path import given_path
from pipeline.motion.limits import Motion
from pipeline.motion.trajectory import frame, rate_of
from sensors.datasheet import Datasheet

if TYPE_CHECKING:
    from pipeline.recipe import RecipeFile

MOST_POINTS: Final = 100_000_000  # in a scan


def check_compression(file: "RecipeFile", document: Document) -> None:
    """See that the package that the shards' compression needs is installed."""
    needed = reader_needs(file.compression)
    if needed is not None and importlib.util.find_spec(needed) is None:
        raise RecipeError(
            f"needs the package {needed}, which isn't installed here",
            where=document.where(("compression",)),
            value=file.compression,
            allowed=f"pip install 'flawforge[{needed}]', or deflate or none",
        )


def check_camera(file: "RecipeFile", datasheet: Datasheet, document: Document) -> None:
    """See that the camera's place is known where brightness is wanted."""
    if file.intensity is not None and datasheet.triangulation_angle_deg is None:
        raise RecipeError(
            "'intensity' needs to know where the camera is",
            where=document.where(("intensity",)),
            allowed="with triangulation_angle_deg, in the recipe or in the sensor's file",
        )


def check_points(file: "RecipeFile", datasheet: Datasheet, document: Document) -> None:
    """See that a scan fits into memory."""
    points = file.points or datasheet.points_per_profile
    if file.profiles * points > MOST_POINTS:
        raise RecipeError(
            "too many points in a scan",
            where=document.where(("profiles",)),
            value=f"{file.profiles} profiles of {points} points",
            allowed=f"{MOST_POINTS} points at most",
        )


def check_motion(motion: Motion, datasheet: Datasheet, profiles: int, where: str) -> None:
    """See before anything is made whether the sensor can move like that at all."""
    try:
        frame(motion.look, motion.travel)
        rate_of(motion, datasheet)
        if motion.path is not None:
            given_path(motion, datasheet, profiles, np.zeros(3))
    except RecipeError as error:
        raise RecipeError(str(error), where=where) from None
