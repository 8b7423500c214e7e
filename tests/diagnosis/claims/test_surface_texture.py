"""Surface texture: a level and a lay put together, beside an unexplained mean."""

import math

import pytest

from diagnosis.claims.surface_texture import Claim, Left, joined
from sensors.effects.anisotropic_lay import AnisotropicLay
from sensors.effects.roughness_level import RoughnessLevel


def level(factor: float) -> Claim:
    return Claim(effect=RoughnessLevel(amplitude=factor), nats=9.0)


def lay(ratio: float) -> Claim:
    return Claim(effect=AnisotropicLay(ratio=ratio, angle_deg=30.0), nats=8.0)


def test_ridges_of_a_lay_make_a_surface_rougher_but_not_smoother() -> None:
    (one,) = joined(level(1.6), lay(2.5))
    assert isinstance(one.effect, AnisotropicLay)
    assert (one.effect.amplitude, one.effect.ratio, one.nats) == (1.6, 2.5, 8.0)
    assert len(joined(level(0.8), lay(2.5))) == 2


def test_what_is_left_of_the_mean_adds_to_the_noise() -> None:
    """Noise with a bent mean of half its size has 1.25 times the variance."""
    assert Left().level == 0.0
    assert Left(mean=0.5).level == pytest.approx(0.5 * math.log(1.25))
    assert Left(mean=0.5, noise=0.3).level == pytest.approx(math.hypot(0.5 * math.log(1.25), 0.3))
