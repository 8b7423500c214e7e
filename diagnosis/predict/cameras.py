"""Cameras that a sensor may have: those that its file leaves out are on either side."""

from collections.abc import Sequence
from dataclasses import replace

from diagnosis.settings import SETTINGS
from sensors.datasheet import Datasheet
from sensors.effects.base import Effect
from sensors.model import SensorModel
from sensors.view.covariates import CAMERA
from sensors.view.view import View


def possible_sheets(
    sheet: Datasheet, needs: Sequence[str], angles_deg: Sequence[float] = ()
) -> list[Datasheet]:
    """Return the sensor's file, or its completions where a camera is needed and not stated.

    Parameters
    ----------
    needs : keys of the file
    angles_deg : that are tried where the file states none
    """
    angle, side = sheet.triangulation_angle_deg, sheet.camera_side
    if not {*CAMERA} & {*needs} or (angle is not None and side is not None):
        return [sheet]
    return [
        replace(sheet, triangulation_angle_deg=a, camera_side=s)
        for a in (angles_deg if angle is None else (angle,))
        for s in (("+y", "-y") if side is None else (side,))
    ]


def needs_of(kind: type[Effect], sheet: Datasheet) -> tuple[str, ...]:
    """Keys of the file that an effect's law may go by: where the camera is, wherever that is known.

    At edges any law is one of what the camera sees.
    """
    known = sheet.triangulation_angle_deg is not None
    return (*kind.needs, *kind.goes_by, *(CAMERA if known else ()))


def possible_views(view: View, needs: Sequence[str]) -> list[View]:
    """Return views by the cameras that the sensor may have."""
    sheets = possible_sheets(view.datasheet, needs, SETTINGS.assumed_angles_deg[1:2])
    return [view if sheet is view.datasheet else with_sheet(view, sheet) for sheet in sheets]


def with_sheet(view: View, sheet: Datasheet) -> View:
    """Return the view by a sensor with another file."""
    return view.with_sensor(SensorModel(sheet))
