"""The bench's strengths against closed forms."""

import math

import numpy as np
import pytest

from benchmarks.diagnose import CASES, NO_STRENGTH, OF
from benchmarks.strength import finish_nats, strength
from diagnosis.noise.noise_model import calibrate
from sensors.effects import CATALOGUE
from sensors.effects.anisotropic_lay import AnisotropicLay
from sensors.effects.roughness_level import RoughnessLevel
from tests.support.effect_case import plain


def test_the_bench_has_every_effect() -> None:
    wanted = set(CATALOGUE) - {"empirical"} - NO_STRENGTH
    assert {case.name for case in CASES} == wanted, "benchmarks/diagnose.py: CASES, NO_STRENGTH"


def test_a_level_tells_as_much_as_so_many_gaussian_numbers() -> None:
    """N (a² - 1 - ln a²) / 2 where all of the noise is speckle."""
    field = np.random.default_rng(0).standard_normal((200, 300))
    noise = calibrate(
        [field], [np.ones(field.shape, dtype=bool)], pitch_mm=(1.0, 1.0), missing_share=0.0,
    )  # fmt: skip
    nats = finish_nats(RoughnessLevel(amplitude=1.3), noise, (70, 90), 0.0)
    assert nats == pytest.approx(0.5 * 70 * 90 * (1.69 - 1 - math.log(1.69)), rel=1e-6)
    for none in (RoughnessLevel(amplitude=1.0), AnisotropicLay(ratio=1.0, angle_deg=20.0)):
        assert finish_nats(none, noise, (70, 90), 0.1) == pytest.approx(0.0, abs=1e-6)


def test_a_mounting_is_held_against_how_parts_lie() -> None:
    """Of n recordings, √n times the turn over the scatter of one."""
    effect = {**OF["pose_error"].entry(1.0), "pitch_deg": 0.1}
    expected = math.sqrt(5) * math.radians(0.1) / 5e-4
    assert strength(OF["pose_error"], effect) == pytest.approx(expected, rel=1e-9)


def test_twice_an_offset_is_twice_as_strong() -> None:
    case = plain("domes")
    one, two = (strength(case, {"name": "line_bow", "sag_um": s}) for s in (3.0, 6.0))
    assert one > 1
    assert two == pytest.approx(2 * one, rel=1e-6)
