"""Baselines: what an instrument had when it was good is no fault."""

from sensors.recording import Recording
from tests.support.diagnosis_of import diagnosis_of
from tests.support.small_parts import VIEWS, datasheet, part, record

NOISY_ENDS: dict[str, object] = {"name": "light_falloff", "share": 0.7, "ends": 0.1}


def test_noise_that_the_baselines_have_too_is_no_fault() -> None:
    scene, sheet = part("domes"), datasheet(90)

    def made(kind: str, seed: int) -> list[Recording]:
        return [
            record(scene, sheet, [NOISY_ENDS], name=f"{kind}{k}", seed=seed + k, profiles=70,
                   pitch_mm=0.6, **view)
            for k, view in enumerate(VIEWS)
        ]  # fmt: skip

    def named(baselines: list[Recording]) -> set[str]:
        found = diagnosis_of(made("r", 10), scene, sheet, baselines=baselines)
        return {e.name for e in found.effects} | {one.detail for one in found.left}

    assert "light_falloff" in named([])
    assert named(made("b", 50)) == set()
