"""Light from many depths averages speckle: a fall of the noise that no texture explains."""


import numpy as np
import pytest

from diagnosis.claims.translucency import averaged_grain
from diagnosis.physics.uncertainty import plain_values
from diagnosis.validate.found_effects import plainly_found
from sensors.casting.scene import Scene
from sensors.effects.roughness_level import RoughnessLevel
from sensors.effects.volume_scattering import VolumeScattering
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


def test_a_material_that_is_named_without_its_law_accounts_for_its_grain() -> None:
    """By what the mean follows: its formula is another, and no depth is estimated."""
    volume = plainly_found(VolumeScattering.none(), 1e-3, {}, probability=0.9)
    rough = RoughnessLevel.none().with_parameters(amplitude=1.4)
    level = plainly_found(rough, 2e-3, plain_values({"amplitude": 1.4}), probability=0.8)
    (both,), rest = averaged_grain([volume], [level], ())
    assert rest == []
    assert both.effect == VolumeScattering.none().with_parameters(grain=1.4)
    assert both.probability == 0.9
    assert both.alternatives == ()
