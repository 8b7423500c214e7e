"""Cameras that a sensor's file doesn't state: those that are tried."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

from diagnosis.components.component import with_sheet
from diagnosis.data.patch import Patch
from diagnosis.evidence.reported_causes import Cause
from diagnosis.settings import SETTINGS
from sensors.datasheet import Datasheet
from sensors.effects import CATALOGUE


def assumed_sheets(sheet: Datasheet, causes: Sequence[Cause]) -> list[Datasheet]:
    """Return the sensor's file, or its completions where a named cause needs what it leaves out.

    A file that leaves the camera's side out has "+y" by default: "-y" was stated.
    """
    needed = {key for c in causes for key in CATALOGUE[c.name].needs}
    if all(getattr(sheet, key) is not None for key in needed):
        return [sheet]
    sides: tuple[Literal["+y", "-y"], ...] = ("+y", "-y")
    return [
        replace(sheet, triangulation_angle_deg=angle, camera_side=side)
        for angle in SETTINGS.assumed_angles_deg
        for side in (sides if sheet.camera_side == "+y" else ("-y",))
    ]


def seen_by(patches: Sequence[Patch], sheet: Datasheet) -> list[Patch]:
    """Look at patches with another sensor's file."""
    if not patches or patches[0].view.datasheet is sheet:
        return list(patches)
    return [replace(p, view=with_sheet(p.view, sheet)) for p in patches]
