"""A diagnosis of recordings of one of the small parts."""

from collections.abc import Iterable, Sequence
from typing import Any

from diagnosis.diagnose import diagnose
from diagnosis.diagnosis import Diagnosis
from diagnosis.explanation import Progress
from diagnosis.prepare import Inputs
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet
from sensors.recording import Recording


def diagnosis_of(
    recordings: Sequence[Recording],
    scene: Scene,
    sheet: Datasheet,
    *,
    withheld: Iterable[str] = (),
    progress: Progress = lambda _: None,
    **more: Any,
) -> Diagnosis:
    """Diagnose recordings of a part; `more` as `Inputs` has it."""
    inputs = Inputs(
        recordings=recordings, vertices_mm=scene.vertices_mm, faces=scene.faces, datasheet=sheet,
        **more,
    )  # fmt: skip
    return diagnose(inputs, withheld=withheld, progress=progress)
