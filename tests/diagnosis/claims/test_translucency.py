"""Light from many depths averages speckle: a fall of the noise that no texture explains."""


import numpy as np
import pytest

from sensors.casting.scene import Scene
from sensors.recording import Recording
from tests.support.diagnosis_of import diagnosis_of
from tests.support.small_parts import SPECKLE, datasheet, part, record, solid


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "named"),
    [
        ({"name": "volume_scattering", "depth_um": 60.0, "grain": 0.55}, "volume_scattering"),
        ({"name": "roughness_level", "amplitude": 1.5}, "roughness_level"),
    ],
)
def test_what_halves_the_noise_is_no_finish(effect: dict[str, object], named: str) -> None:
    blocks, sheet = part("steps"), datasheet(110)
    sides = np.linspace(-30, 30, 5)
    plate = solid(lambda x, y: np.zeros_like(x), sides, sides)

    def scan(where: Scene, k: int, effects: list[dict[str, object]]) -> Recording:
        return record(
            where, sheet, effects, name=f"s{k}", seed=60 + k, profiles=90, speckle=SPECKLE,
            heading_deg=90.0 * k, tilt_deg=(4.0, 3.0),
        )  # fmt: skip

    result = diagnosis_of(
        [scan(blocks, k, [effect]) for k in range(3)], blocks, sheet,
        references=[scan(plate, k, []) for k in (4, 5)],
    )  # fmt: skip
    first = result.effects[0]
    assert first.name == named
    if named == "volume_scattering":
        assert first.effect.grain == pytest.approx(0.55, rel=0.2)
        # flats don't say how deep; a finish stays its rival
        assert (first.parameters["depth_um"].low or 0.0) > 0 or first.alternatives
