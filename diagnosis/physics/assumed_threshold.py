"""How little of a line's light still gives a reading, where the sensor's file doesn't state it.

Beside a shadow the camera sees a part of the line only. Below a threshold of its light the peak
finder gives no reading, and no datasheet states this threshold. Readings beside shadows show it:
with another one they are lost, or come from where none is expected, all along the shadow.
"""

from collections.abc import Sequence

from diagnosis.data.patch import Patch
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.noise.calibration import calibrated_noise
from diagnosis.physics.assumed_camera import seen_by
from diagnosis.settings import SETTINGS
from sensors.datasheet import Datasheet, with_effects
from sensors.effects.camera_occlusion import CameraOcclusion


def with_threshold(
    sheet: Datasheet, patches: Sequence[Patch], baseline: Sequence[Patch]
) -> Datasheet:
    """Return the sensor's file with the threshold that suits the readings best.

    As it is where it states one, lists no shadow of a line with a width, or where no other
    threshold suits them better; of equals, the nearest to the default.

    Parameters
    ----------
    patches, baseline : of recordings, whose noise is taken, and of baselines
    """
    listed = next((e for e in sheet.effects if e["name"] == CameraOcclusion.name), None)
    if listed is None or "weakest" in listed or not listed.get("line_sd_um"):
        return sheet
    tried = [
        with_effects(sheet, ({**listed, "weakest": share},))
        for share in SETTINGS.physics.weakest_shares
    ]
    noise, _ = calibrated_noise(patches, (), [])
    ws = Workspace.build([p for p in (*patches, *baseline) if p.fit.any()], noise)
    ws = ws.thin(SETTINGS.physics.tried_readings)

    def nats(one: Datasheet) -> float:
        return Workspace.build(seen_by(ws.patches, one), noise).most_probable(Model())

    return max([sheet, *tried], key=nats)
