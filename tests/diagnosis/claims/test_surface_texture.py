"""Surface texture: a level and a lay put together, beside an unexplained mean."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.claims.lay import LAY
from diagnosis.claims.surface_texture import Claim, Left, _lay, joined
from diagnosis.settings import SETTINGS
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


@pytest.mark.parametrize(("fitted", "heldout"), [(14.0, 10.0), (26.0, None)])
def test_a_lay_is_weighed_by_all_recordings(
    monkeypatch: pytest.MonkeyPatch, fitted: float, heldout: float | None
) -> None:
    """Where held-out ones show less of it, it is for their readings to be more probable with it."""
    sizes = SETTINGS.mean_sizes()
    at_all, seen = np.log(np.where(sizes == sizes[-2], 1.0, 1e-300)), [24.0, fitted]
    lay_found = AnisotropicLay(ratio=2.0, angle_deg=30.0)
    module = "diagnosis.claims.surface_texture"
    monkeypatch.setattr(f"{module}.lay_of", lambda *_: (lay_found, at_all + seen.pop(0)))
    monkeypatch.setattr(f"{module}.all_fitted", lambda patches: patches)
    monkeypatch.setattr(f"{module}.Workspace", SimpleNamespace(build=lambda *_: None))
    usual = np.full(sizes.size, 1e-12)
    usual[0] = 1.0
    explanation = SimpleNamespace(patches=(), model=None, scales={LAY: usual})
    claim = _lay(explanation, None, None, (), Left())
    assert claim is not None
    assert claim.effect is lay_found
    assert claim.heldout == (None if heldout is None else pytest.approx(heldout))
