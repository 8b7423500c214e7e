"""A lay is known by the direction in which it draws the noise out, and keeps it on the part."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import binary_dilation
from scipy.special import logsumexp

from diagnosis.claims.lay import Lay, lay_evidence, lay_of, stretched
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.noise.noise_model import calibrate
from diagnosis.prepare import Inputs, prepared
from diagnosis.settings import SETTINGS
from sensors.casting.scene import Scene
from sensors.effects.anisotropic_lay import AnisotropicLay
from sensors.recording import Recording
from tests.support.diagnosis_of import diagnosis_of
from tests.support.small_parts import SPECKLE, datasheet, knots, part, poses, record, solid
from tests.support.spectra import (
    ANGLE_DEG,
    NOMINAL,
    READINGS,
    SHARE,
    SPECKLE_POWER,
    noise_of,
    recordings,
    strip,
)


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
        pitch_mm=(pitch_x, pitch_y), missing_share=0.0,
    )  # fmt: skip
    stretch = complex(*stretched(noise))
    if ratio == 1.0:
        assert abs(stretch) < 0.1
        return
    # of an elliptic spot of axes a and b, the lengths along both differ by a / b
    assert abs(stretch) == pytest.approx(math.log(ratio), rel=0.25)
    off = (math.degrees(math.atan2(stretch.imag, stretch.real)) / 2 - angle_deg + 90) % 180 - 90
    assert abs(off) < 6


HEADINGS = (5.0, 95.0, 185.0)
MANY = (5.0, 95.0, 185.0, 275.0, 50.0, 140.0)
UNDECIDED = -SETTINGS.log_odds(AnisotropicLay.name)


def turn(heading_deg: float) -> np.ndarray:
    """Map twice a direction on the part to the scan of a part turned by that much."""
    c, s = (f(2 * math.radians(heading_deg)) for f in (math.cos, math.sin))
    return np.array([[c, s], [-s, c]])


def nats(lay: Lay) -> float:
    """Log Bayes factor of a lay of any size."""
    return float(logsumexp(lay.factors) - math.log(lay.factors.size))


def weighed(
    lay: float, own: float, before: float | None = None, *, scatter: float = 0.0,
    headings: tuple[float, ...] = HEADINGS, listed: bool = False,
) -> Lay:  # fmt: skip
    now = recordings(lay, own, headings, scatter=scatter)
    other = (50.0, 140.0, 230.0)
    good = [] if before is None else recordings(before, 0.0, other, seed=1)
    found = lay_evidence(
        now, [turn(h) for h in headings], good, [turn(h) for h in other] if good else [],
        NOMINAL, listed=listed,
    )  # fmt: skip
    if nats(found) > 3:
        off = math.degrees(found.angle_rad) - ANGLE_DEG
        assert abs((off + 90) % 180 - 90) < 5
    return found


def test_what_turns_with_the_part_is_a_lay_and_what_does_not_is_none() -> None:
    assert nats(weighed(SHARE, 0.0)) > 15
    assert nats(weighed(SHARE, SHARE)) > 10
    assert nats(weighed(0.0, SHARE)) < 0
    assert nats(weighed(0.0, 0.0)) < -1


def test_what_differs_between_recordings_is_none() -> None:
    turns = [turn(h) for h in MANY]
    found = [
        nats(lay_evidence(recordings(0.0, 0.0, MANY, scatter=SHARE, seed=seed),
                          turns, [], [], NOMINAL))
        for seed in range(6)
    ]  # fmt: skip
    assert max(found) < 0


@pytest.mark.parametrize("share", [0.03, 0.06, 0.12])
def test_one_recording_that_is_drawn_out_by_itself_is_no_sign_of_a_lay(share: float) -> None:
    """Noise of good instruments is drawn out a little in another direction in each recording."""
    rng = np.random.default_rng(3)
    own = noise_of(SPECKLE_POWER + share * strip(ANGLE_DEG - HEADINGS[2]), rng, READINGS)
    seen = [*recordings(0.0, 0.0, HEADINGS[:2]), own]
    other = (50.0, 140.0)
    found = lay_evidence(
        seen, [turn(h) for h in HEADINGS], recordings(0.0, 0.0, other, seed=1),
        [turn(h) for h in other], NOMINAL,
    )  # fmt: skip
    assert nats(found) < 1


def test_a_lay_that_baselines_or_the_file_have_is_no_change() -> None:
    assert nats(weighed(SHARE, 0.0, SHARE)) < 0
    assert nats(weighed(SHARE, 0.0, listed=True)) < UNDECIDED
    assert nats(weighed(SHARE, 0.0, 0.0)) > 10
    assert nats(weighed(SHARE, SHARE, 0.0)) > 10
    assert nats(weighed(2 * SHARE, 0.0, SHARE)) > 10
    assert nats(weighed(0.0, SHARE, 0.0)) < 0


def test_recordings_in_one_orientation_do_not_tell_a_lay_from_the_sensor() -> None:
    assert nats(weighed(SHARE, 0.0, headings=(30.0, 30.0, 30.0))) < UNDECIDED


def test_evidence_is_a_part_of_what_knowing_the_spectra_would_give() -> None:
    """Whittle's divergence of the true spectra pays for what isn't known, and for alternatives.

    The part is one, in however many recordings.
    """
    gain, share = 0.0, 0.5 * SHARE
    for heading in MANY:
        ratio = 1 + share * strip(ANGLE_DEG - heading) / SPECKLE_POWER
        ratio /= ratio.mean()
        gain += 0.5 * READINGS / len(MANY) * float((ratio - 1 - np.log(ratio)).mean())
    assert 0.2 * gain < nats(weighed(share, 0.0, headings=MANY)) < gain


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


def test_readings_beside_edges_say_nothing_of_a_lay() -> None:
    """Edges of a part have one direction, and so has what light leaves along them."""
    walls, sheet = (-15.0, -5.0, 5.0, 15.0), datasheet(110)
    ridges = solid(
        lambda x, y: 1.0 * (np.searchsorted(walls, x) % 2), knots(52, 27, walls), knots(52, 5)
    )

    def scan(of: Scene, k: int, heading_deg: float = 0.0) -> Recording:
        return record(of, sheet, [], name=f"s{k}", seed=70 + k, profiles=100, speckle=SPECKLE,
                      heading_deg=heading_deg)  # fmt: skip

    ready = prepared(
        Inputs(
            recordings=[scan(ridges, k, heading) for k, heading in enumerate((0.0, 80.0, 40.0))],
            vertices_mm=ridges.vertices_mm, faces=ridges.faces, datasheet=sheet,
            references=[scan(part("plate"), 7), scan(part("plate"), 8)],
        ),
        [], lambda _: None,
    )  # fmt: skip
    assert ready.nominal is not None

    def factors(first: int, last: int) -> np.ndarray:
        """Raise readings by the noise that lie so many points beside those at edges."""
        patches = []
        for patch in ready.patches:
            inner, outer = (
                binary_dilation(patch.edge, iterations=k) if k else patch.edge
                for k in (first, last)
            )
            raised = ready.noise.sd_mm * (outer & ~inner)
            patches.append(replace(patch, depth_mm=patch.depth_mm + raised))
        found = lay_of(Workspace.build(patches, ready.noise), Model(), ready.nominal)
        assert found is not None
        return found[1]

    beside = 3
    assert np.allclose(factors(0, beside), factors(0, 0), atol=1e-3)
    assert not np.allclose(factors(0, SETTINGS.claims.lay_off_edges + 2), factors(0, 0), atol=0.1)
