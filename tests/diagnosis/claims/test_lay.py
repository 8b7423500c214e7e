"""A lay is known by the direction in which it draws the noise out, and keeps it on the part."""

import math

import numpy as np
import pytest

from diagnosis.claims.lay import Drawn, drawn, lay_evidence
from diagnosis.noise.noise_model import calibrate
from sensors.effects.anisotropic_lay import AnisotropicLay
from sensors.recording import Recording
from tests.support.diagnosis_of import diagnosis_of
from tests.support.small_parts import SPECKLE, datasheet, poses, record, solid


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
    stretch = complex(*drawn(noise).stretch)
    if ratio == 1.0:
        assert abs(stretch) < 0.1
        return
    # of an elliptic spot of axes a and b, the lengths along both differ by a / b
    assert abs(stretch) == pytest.approx(math.log(ratio), rel=0.25)
    off = (math.degrees(math.atan2(stretch.imag, stretch.real)) / 2 - angle_deg + 90) % 180 - 90
    assert abs(off) < 6


EVEN = Drawn(z=np.zeros((3, 2)), variance=np.full(3, 1e-5), stretch=np.zeros(2))
HEADINGS = (5.0, 95.0, 185.0, 40.0)
LAY = np.array([0.05, 0.08])
OWN = np.array([-0.1, 0.02])


def turn(heading_deg: float) -> np.ndarray:
    """Map twice a direction on the part to the scan of a part turned by that much."""
    c, s = (f(2 * math.radians(heading_deg)) for f in (math.cos, math.sin))
    return np.array([[c, s], [-s, c]])


def seen(
    on_part: np.ndarray, own: np.ndarray, *, scatter: float = 0.0, seed: int = 0
) -> list[Drawn]:
    """Draw recordings of each heading, with what is the part's and what is the sensor's own."""
    rng = np.random.default_rng(seed)
    sd = np.hypot(np.sqrt(1e-5), scatter)
    return [
        Drawn(z=turn(h) @ on_part + own + sd * rng.standard_normal((3, 2)),
              variance=np.full(3, 1e-5), stretch=np.zeros(2))
        for h in HEADINGS
    ]  # fmt: skip


def nats(
    on_part: np.ndarray, own: np.ndarray, before: np.ndarray | None = None, *, scatter: float = 0.0,
    headings: tuple[float, ...] = HEADINGS, listed: bool = False,
) -> float:  # fmt: skip
    turns = [turn(h) for h in headings]
    now = seen(on_part, own, scatter=scatter)
    good = [] if before is None else seen(before, np.zeros(2), scatter=scatter, seed=1)
    found = lay_evidence(now, turns, good, turns if good else [], EVEN, listed=listed)
    if found.nats > 3:
        u, v = on_part if before is None else on_part - before
        off = found.angle_rad - 0.5 * math.atan2(v, u)
        assert abs((off + math.pi / 2) % math.pi - math.pi / 2) < math.radians(5)
    return found.nats


def test_what_turns_with_the_part_is_a_lay_and_what_does_not_is_none() -> None:
    none = np.zeros(2)
    assert nats(LAY, OWN) > 6
    assert nats(LAY, none) > 6
    assert nats(none, OWN) < 0
    assert nats(none, none) < 0
    # what scatters from one recording to another as much is no evidence of a direction
    assert nats(none, none, scatter=0.1) < 3


def test_a_lay_that_baselines_or_the_file_have_is_no_change() -> None:
    none = np.zeros(2)
    assert nats(LAY, none, LAY) < 0
    assert nats(LAY, none, listed=True) < 0
    assert nats(LAY, OWN, none) > 10
    assert nats(2 * LAY, none, LAY) > 10
    assert nats(none, OWN, none) < 0


def test_recordings_in_one_orientation_do_not_tell_a_lay_from_the_sensor() -> None:
    turns = [turn(30.0)] * 3
    alike = [Drawn(z=np.tile(turns[0] @ LAY, (3, 1)), variance=np.full(3, 1e-5),
                   stretch=np.zeros(2))] * 3  # fmt: skip
    assert lay_evidence(alike, turns, [], [], EVEN).nats < 1


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

    result = diagnosis_of(
        [scan(0, 0.0, lay), scan(1, 90.0, lay), scan(2, 180.0, lay)],
        plate, sheet, references=[scan(7, 0.0, []), scan(8, 90.0, [])],
    )  # fmt: skip
    found = next(e for e in result.effects if e.name == "anisotropic_lay")
    assert isinstance(found.effect, AnisotropicLay)
    off = (found.effect.angle_deg - 50.0 + 90) % 180 - 90
    assert abs(off) < 15
    # seen from above, the travel is mirrored: the angle on the part isn't the one in the scan
    line, travel = poses(3)[0, :2, 0], poses(3)[0, :2, 1]
    assert np.linalg.det(np.stack([line, travel])) == pytest.approx(-1.0)
