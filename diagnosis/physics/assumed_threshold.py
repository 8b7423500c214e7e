"""How little of a line's light still gives a reading, where the sensor's file doesn't state it.

Beside a shadow the camera sees a part of the line only. Below a threshold of its light the peak
finder gives no reading, and no datasheet states this threshold. Readings beside shadows show it:
with another one they are lost, or come from where none is expected, all along the shadow.
"""

from collections.abc import Iterator, Sequence
from typing import Any

from diagnosis.data.patch import Patch
from diagnosis.model.model import Model
from diagnosis.physics.assumed_camera import trial_readings
from diagnosis.settings import SETTINGS
from sensors.datasheet import Datasheet, with_effects
from sensors.effects import CATALOGUE


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
    tried = list(_untold(sheet))
    if not tried:
        return sheet
    ws = trial_readings(patches, baseline)

    def nats(listed: dict[str, Any] | None) -> float:
        # in place of the listed effect: what light reaches the camera is the same for all of them
        effect = () if listed is None else (CATALOGUE[listed["name"]].from_mapping(listed),)
        return ws.most_probable(Model(effects=effect))

    best = max([None, *tried], key=nats)
    return sheet if best is None else with_effects(sheet, (best,))


def _untold(sheet: Datasheet) -> Iterator[dict[str, Any]]:
    """Yield each listed effect of a line with a width that leaves its threshold out, with one."""
    for listed in sheet.effects:
        kind = CATALOGUE[listed["name"]]
        if kind.least_light and kind.least_light not in listed and listed.get(kind.line_width):
            for share in SETTINGS.physics.weakest_shares:
                yield {**listed, kind.least_light: share}
