"""Surface texture: a level and a lay put together, and what a bent mean leaves of them."""

import pytest

from diagnosis.claims.surface_texture import Claim, joined
from sensors.effects.anisotropic_lay import AnisotropicLay
from sensors.effects.roughness_level import RoughnessLevel


def level(factor: float) -> Claim:
    return Claim(effect=RoughnessLevel(amplitude=factor), nats=9.0)


def lay(ratio: float) -> Claim:
    return Claim(effect=AnisotropicLay(ratio=ratio, angle_deg=30.0), nats=8.0)


@pytest.mark.parametrize(("ratio", "bent", "told"), [
    (1.5, False, True), (1.5, True, False), (2.5, False, True), (2.5, True, True),
])  # fmt: skip
def test_beside_a_bent_mean_a_strong_lay_alone_is_told(
    ratio: float, bent: bool, told: bool
) -> None:
    names = [c.effect.name for c in joined(level(0.8), lay(ratio), bent=bent)]
    shown = (("roughness_level", not bent), ("anisotropic_lay", told))
    assert names == [n for n, one in shown if one]


def test_a_bent_mean_makes_no_noise_small() -> None:
    assert joined(level(0.6), None, bent=True) == [level(0.6)]
    assert joined(level(1.6), None, bent=True) == []


def test_ridges_of_a_lay_make_a_surface_rougher_but_not_smoother() -> None:
    (one,) = joined(level(1.6), lay(2.5), bent=False)
    assert isinstance(one.effect, AnisotropicLay)
    assert (one.effect.amplitude, one.effect.ratio, one.nats) == (1.6, 2.5, 8.0)
    assert len(joined(level(0.8), lay(2.5), bent=False)) == 2
