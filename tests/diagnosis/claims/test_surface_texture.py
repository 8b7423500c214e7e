"""A lay is told by the direction in which it draws the noise out; a finish by its level."""

import cmath
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from diagnosis.claims import surface_texture
from diagnosis.claims.surface_texture import _stretch
from diagnosis.diagnose import diagnose
from diagnosis.model.workspace import Model
from diagnosis.noise.noise_model import calibrate
from sensors.casting.scene import Scene
from sensors.effects.anisotropic_lay import AnisotropicLay
from sensors.model import SensorModel
from sensors.recording import Recording
from sensors.view.view import View
from tests.support.small_parts import SPECKLE, datasheet, part, poses, record, solid


@pytest.mark.parametrize(("ratio", "angle_deg"), [(1.0, 0.0), (2.5, 0.0), (2.5, 35.0), (2.0, 90.0)])
def test_stretch_is_the_noise_s_ratio_and_direction(ratio: float, angle_deg: float) -> None:
    rng = np.random.default_rng(1)
    pitch_x, pitch_y = 0.2, 0.3
    k_y = np.fft.fftfreq(300, pitch_y)[:, None]
    k_x = np.fft.rfftfreq(400, pitch_x)[None, :]
    turn = math.radians(angle_deg)
    along = k_x * math.cos(turn) + k_y * math.sin(turn)
    across = -k_x * math.sin(turn) + k_y * math.cos(turn)
    size = 2 * math.pi * 0.35
    root = np.exp(-0.25 * size**2 * (ratio * along**2 + across**2 / ratio))
    field = np.fft.irfft2(np.fft.rfft2(rng.standard_normal((300, 400))) * root, s=(300, 400))
    noise = calibrate(
        [0.01 * field / field.std()], [np.ones(field.shape, dtype=bool)],
        pitch_mm=(pitch_x, pitch_y), missing_share=0.0, from_reference=False,
    )  # fmt: skip
    stretch = _stretch(noise)
    if ratio == 1.0:
        assert abs(stretch) < 0.1
        return
    # of an elliptic spot of axes a and b, the lengths along both differ by a / b
    assert abs(stretch) == pytest.approx(math.log(ratio), rel=0.25)
    off = (math.degrees(cmath.phase(stretch)) / 2 - angle_deg + 90) % 180 - 90
    assert abs(off) < 6


def test_a_lay_between_the_axes_keeps_its_angle_on_the_part() -> None:
    sides = np.linspace(-30, 30, 5)
    plate = solid(lambda x, y: np.zeros_like(x), sides, sides)
    sheet = datasheet(110)
    lay = [{"name": "anisotropic_lay", "ratio": 6.0, "angle_deg": 50.0}]

    def scan(k: int, heading_deg: float, effects: list[dict[str, object]]) -> Recording:
        return record(
            plate, sheet, effects, name=f"s{k}", seed=40 + k, profiles=100, speckle=SPECKLE,
            heading_deg=heading_deg, tilt_deg=(4.0, 3.0),
        )  # fmt: skip

    result = diagnose(
        [scan(0, 0.0, lay), scan(1, 90.0, lay), scan(2, 180.0, lay)],
        plate.vertices_mm, plate.faces, sheet, references=[scan(7, 0.0, []), scan(8, 90.0, [])],
    )  # fmt: skip
    found = next(e for e in result.effects if e.name == "anisotropic_lay")
    assert isinstance(found.effect, AnisotropicLay)
    off = (found.effect.angle_deg - 50.0 + 90) % 180 - 90
    assert abs(off) < 15
    # seen from above, the travel is mirrored: the angle on the part isn't the one in the scan
    line, travel = poses(3)[0, :2, 0], poses(3)[0, :2, 1]
    assert np.linalg.det(np.stack([line, travel])) == pytest.approx(-1.0)


def names_told(
    monkeypatch: pytest.MonkeyPatch, lay: AnisotropicLay | None, level: float, *, bent: bool
) -> list[str]:
    """Return the effects told where a lay and a factor on the noise's size were measured."""
    monkeypatch.setattr(surface_texture, "_lay", lambda *args, **more: lay)
    monkeypatch.setattr(surface_texture, "level_change", lambda *args: math.log(level))
    view = View(part("steps"), SensorModel(datasheet(40)), poses(3), np.arange(3.0))
    ws: Any = SimpleNamespace(patches=[SimpleNamespace(view=view)])
    noise: Any = SimpleNamespace(
        correlation_length_px=lambda: (1.0, 1.0), acf=np.ones((1, 1)), readings=20_000
    )
    effects = surface_texture.finish_effects(ws, Model(), noise, noise, 0.01, {}, bent=bent)
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

    result = diagnose(
        [scan(blocks, k, [effect]) for k in range(3)], blocks.vertices_mm, blocks.faces, sheet,
        references=[scan(plate, k, []) for k in (4, 5)],
    )  # fmt: skip
    first = result.effects[0]
    assert first.name == named
    if named == "volume_scattering":
        assert first.effect.grain == pytest.approx(0.55, rel=0.2)
        # flats don't say how deep; a finish stays its rival
        assert (first.parameters["depth_um"].low or 0.0) > 0 or first.alternatives
