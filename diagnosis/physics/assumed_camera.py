"""Cameras that a sensor's file doesn't state: those that are tried, and how readings tell."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from diagnosis.data.patch import Patch
from diagnosis.evidence.reported_causes import Cause
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.noise.calibration import calibrated_noise
from diagnosis.predict.cameras import needs_of, possible_sheets, with_sheet
from diagnosis.settings import SETTINGS
from sensors.datasheet import Datasheet
from sensors.effects import CATALOGUE
from sensors.view.covariates import CAMERA


def assumed_sheets(sheet: Datasheet, causes: Sequence[Cause]) -> list[Datasheet]:
    """Return the sensor's file, or its completions where a named cause needs what it leaves out."""
    needed = [key for c in causes for key in needs_of(CATALOGUE[c.name], sheet)]
    return possible_sheets(sheet, needed, SETTINGS.assumed_angles_deg)


def with_side(
    sheet: Datasheet, patches: Sequence[Patch], baseline: Sequence[Patch]
) -> Datasheet:
    """Return the sensor's file with the camera on the side that suits the readings best.

    As it is where it states one, where it lists no law that a camera has a part in, or where
    readings don't tell the sides apart. Where the camera is, listed shadows may state.

    Parameters
    ----------
    patches, baseline : of recordings, whose noise is taken, and of baselines
    """
    sheet = _as_listed(sheet)
    listed = [key for e in sheet.effects for key in needs_of(CATALOGUE[e["name"]], sheet)]
    if len(possible_sheets(sheet, listed)) < 2:
        return sheet
    sides = from_either_side(trial_readings(patches, baseline))
    nats = [one.most_probable(Model()) for one in sides]
    if np.ptp(nats) < SETTINGS.stands_out:
        return sheet
    return sides[int(np.argmax(nats))].patches[0].view.datasheet


def trial_readings(patches: Sequence[Patch], baseline: Sequence[Patch]) -> Workspace:
    """Return the readings on which values are tried that the sensor's file leaves out."""
    noise, _ = calibrated_noise(patches, (), [])
    ws = Workspace.build([p for p in (*patches, *baseline) if p.fit.any()], noise)
    return ws.thin(SETTINGS.physics.tried_readings)


def _as_listed(sheet: Datasheet) -> Datasheet:
    """Take from listed effects what the file leaves out of the camera, where they agree on it."""
    for key in (*CAMERA, "camera_side"):
        stated = {e[key] for e in sheet.effects if e.get(key)}
        if getattr(sheet, key) is None and len(stated) == 1:
            sheet = replace(sheet, **{key: stated.pop()})
    return sheet


def seen_by(patches: Sequence[Patch], sheet: Datasheet) -> list[Patch]:
    """Look at patches with another sensor's file."""
    if not patches or patches[0].view.datasheet is sheet:
        return list(patches)
    return [replace(p, view=with_sheet(p.view, sheet)) for p in patches]


def from_either_side(ws: Workspace) -> list[Workspace]:
    """Look at a workspace's patches from either side, where that alone isn't stated of a camera."""
    sheets = possible_sheets(ws.patches[0].view.datasheet, CAMERA)
    return [replace(ws, patches=tuple(seen_by(ws.patches, sheet))) for sheet in sheets] or [ws]
