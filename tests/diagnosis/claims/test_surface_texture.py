"""Surface texture: beside a bent mean only what stands out by far is reported."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from diagnosis.claims import surface_texture
from diagnosis.claims.plate_noise import LevelChange
from diagnosis.model.model import Model
from sensors.effects.anisotropic_lay import AnisotropicLay
from sensors.model import SensorModel
from sensors.view.view import View
from tests.support.small_parts import datasheet, part, poses


def names_told(
    monkeypatch: pytest.MonkeyPatch, lay: AnisotropicLay | None, level: float, *, bent: bool
) -> list[str]:
    """Return the effects told where a lay and a factor on the noise's size were measured."""
    monkeypatch.setattr(surface_texture, "lay_of", lambda *args, **more: lay)
    change = LevelChange(log=math.log(level), unsure=0.01)
    monkeypatch.setattr(surface_texture, "level_change", lambda *args: change)
    view = View(part("steps"), SensorModel(datasheet(40)), poses(3), np.arange(3.0))
    ws: Any = SimpleNamespace(patches=[SimpleNamespace(view=view)])
    noise: Any = SimpleNamespace(
        correlation_length_px=lambda: (1.0, 1.0), acf=np.ones((1, 1)), readings=20_000
    )
    effects = surface_texture.texture_effects(ws, Model(), noise, noise, 0.01, {}, bent=bent)
    return [e.name for e in effects]


@pytest.mark.parametrize(("ratio", "bent", "told"), [
    (1.5, False, True), (1.5, True, False), (2.5, False, True), (2.5, True, True),
])  # fmt: skip
def test_beside_a_bent_mean_a_strong_lay_alone_is_told(
    monkeypatch: pytest.MonkeyPatch, ratio: float, bent: bool, told: bool
) -> None:
    lay = AnisotropicLay(ratio=ratio, angle_deg=30.0)
    names = names_told(monkeypatch, lay, 0.8, bent=bent)
    assert names == [n for n, shown in (("roughness_level", not bent), (lay.name, told)) if shown]


def test_a_bent_mean_makes_no_noise_small(monkeypatch: pytest.MonkeyPatch) -> None:
    assert names_told(monkeypatch, None, 0.6, bent=True) == ["roughness_level"]
