"""Recordings of a small part as a diagnosis prepares them: checked, registered, noise measured."""

from collections.abc import Sequence

from diagnosis.prepare import Inputs, Prepared, prepared
from sensors.recording import Recording
from tests.support.small_parts import VIEWS, datasheet, part, record

Entries = Sequence[dict[str, object]]


def ready(
    effects: Entries, seed: int, *, baselines: bool = False, name: str = "domes"
) -> Prepared:
    """Prepare three recordings of a part with effects in them; baselines have none."""
    scene, sheet = part(name), datasheet(100)

    def scans(what: Entries, first: int) -> list[Recording]:
        return [
            record(scene, sheet, what, name=f"r{first + k}", seed=first + k, profiles=72,
                   pitch_mm=0.6, **view)
            for k, view in enumerate(VIEWS)
        ]  # fmt: skip

    return prepared(
        Inputs(
            recordings=scans(effects, 10 * seed), vertices_mm=scene.vertices_mm,
            faces=scene.faces, datasheet=sheet,
            baselines=scans([], 10 * seed + 5) if baselines else (),
        ),
        [], lambda _: None,
    )  # fmt: skip
