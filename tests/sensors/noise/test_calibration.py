"""The calibrated noise: what is measured on fresh simulated scans is what was wanted."""

import base64
import json
from pathlib import Path

import numpy as np
import pytest

from sensors.noise.calibration import calibrate
from sensors.noise.noise_target import QUANTILES, NoiseTarget, distribution, measure, simulate
from sensors.noise.spectrum import decibels
from sensors.recording import repeated_rows
from sensors.surface.form import remove_form
from sensors.surface.roughness import FIGURES, roughness
from sensors.surface.surface import Surface

Floats = np.ndarray


def fresh(seed: int) -> tuple[np.random.Generator, np.random.Generator]:
    return np.random.default_rng([seed, 10]), np.random.default_rng([seed, 11])


def errors_of(surface: Surface, depth_mm: float = 0.0) -> Floats:
    """Relative errors of the seven figures over ten scans of the paper's window."""
    assert surface.pitch_x_mm is not None
    assert surface.pitch_y_mm is not None
    window = NoiseTarget(pitch_x_mm=surface.pitch_x_mm, pitch_y_mm=surface.pitch_y_mm)
    field = surface.field()
    found = [
        roughness(simulate(field, window, *fresh(seed), depth_mm), surface.pitch_x_mm).values()
        for seed in range(10)
    ]
    return np.mean(found, axis=0) / [getattr(surface, name) for name in FIGURES] - 1.0


@pytest.mark.parametrize("depth_mm", [0.0, 400.0019])
def test_tables_2_to_4_are_met_over_ten_seeds_the_calibration_never_saw(depth_mm: float) -> None:
    """The paper's own simulation misses them by 3.78 % on average and 9.43 % at worst."""
    errors = np.abs(
        [errors_of(Surface.load(n), depth_mm) for n in ("bearing_cap", "car_door", "steel_plate")]
    )
    assert errors.mean() < 0.01
    assert errors.max() < 0.02


def test_verbatim_model_is_far_from_the_tables() -> None:
    """As printed, with unit gradients, every height is at least a quarter too small."""
    for name in ("bearing_cap", "car_door", "steel_plate"):
        surface = Surface.load(name)
        assert surface.pitch_x_mm is not None
        assert surface.pitch_y_mm is not None
        window = NoiseTarget(pitch_x_mm=surface.pitch_x_mm, pitch_y_mm=surface.pitch_y_mm)
        readings = simulate(surface.field(verbatim=True), window, *fresh(0))
        found = roughness(readings, surface.pitch_x_mm)
        for figure in FIGURES[:6]:
            assert getattr(found, figure) < 0.75 * getattr(surface, figure)


def test_three_figures_alone_are_met() -> None:
    wanted = NoiseTarget(
        pitch_x_mm=0.1, pitch_y_mm=0.2, rpm_mm=0.040, rvm_mm=0.050, pc_per_mm=2.4, points=256
    )
    solution = calibrate(wanted)
    assert solution.worst_error < 0.01
    found = [
        roughness(simulate(solution.field, wanted, *fresh(seed)), 0.1).values()
        for seed in range(20)
    ]
    rpm, rvm, pc = np.mean(found, axis=0)[4:]
    assert rpm == pytest.approx(0.040, rel=0.02)
    assert rvm == pytest.approx(0.050, rel=0.02)
    assert pc == pytest.approx(2.4, rel=0.02)


def test_same_inputs_same_noise_solved_once() -> None:
    inputs = {"pitch_x_mm": 0.1, "pitch_y_mm": 0.1, "rq_mm": 0.01, "pc_per_mm": 2.0}
    first = calibrate(NoiseTarget(**inputs, points=100, profiles=16))
    again = calibrate(NoiseTarget(**inputs, points=100, profiles=16))
    assert again is first
    calibrate.cache_clear()
    anew = calibrate(NoiseTarget(**inputs, points=100, profiles=16))
    assert anew == first
    assert anew is not first


def test_calibrated_noise_has_no_mean_and_tame_ends() -> None:
    for name in ("bearing_cap", "car_door", "steel_plate"):
        surface = Surface.load(name)
        assert surface.rp_mm is not None
        assert surface.rq_mm is not None
        heights = surface.field().heights
        assert heights is not None
        ends = heights(np.array([-6.0, 6.0]))
        assert np.abs(ends).max() < 2.0 * surface.rp_mm
        z = surface.field().sample(np.arange(500) * 0.045, np.arange(500) * 0.3, fresh(1)[0])
        assert abs(z.mean()) < 0.03 * surface.rq_mm


@pytest.mark.parametrize(
    ("wrong", "said"), [({"rq_mm": -1.0}, "positive"), ({"pc_per_mm": 8.0}, "every second point")]
)
def test_what_no_scan_can_have_is_refused(wrong: dict[str, float], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        NoiseTarget(pitch_x_mm=0.1, pitch_y_mm=0.1, **wrong)


def flat_region(path: Path) -> tuple[Floats, float, float, float]:
    """Return the smooth part of a SICK height map of a panel; heights and pitches in mm."""
    images = [entry["data"] for entry in json.loads(path.read_text())]
    image = images[0]
    pixels, size = image["Data"]["Pixels"], image["PixelSize"]
    raw = np.frombuffer(base64.b64decode(pixels["data"]), dtype=">u2")
    heights = raw.reshape(image["Data"]["Height"], image["Data"]["Width"]) * size["z"]
    heights = heights[~repeated_rows(heights)]
    return heights[10:230, 250:640], size["x"], size["y"], size["z"]


@pytest.mark.slow
def test_real_recordings_unseen_half(shared_dir: Path) -> None:
    """Fitted on the first half of a real scan: figures, heights and spectra of the second."""
    heights, pitch_x, pitch_y, step = flat_region(shared_dir / "real/sick/OCR_3D_image_42.json")
    seen, unseen = (
        measure(half, pitch_x, pitch_y, resolution_mm=step, cutoff_mm=2.5)
        for half in np.array_split(heights, 2)
    )
    field = calibrate(seen).field
    scans = [
        remove_form(simulate(field, unseen, *fresh(seed)), pitch_x, 2.5) for seed in range(10)
    ]
    found = np.mean([roughness(scan, pitch_x).values() for scan in scans], axis=0)
    wanted = np.array(list(unseen.figures().values()))
    assert np.abs(found / wanted - 1.0).max() < 0.05

    second = remove_form(np.array_split(heights, 2)[1], pitch_x, 2.5)
    real, simulated = np.sort(second.ravel()), np.sort(np.ravel(scans))
    at = np.linspace(-0.15, 0.15, 2001)
    cdf = np.searchsorted(real, at) / real.size - np.searchsorted(simulated, at) / simulated.size
    assert np.abs(cdf).max() < 0.05

    parts = [distribution(unseen, scan) for scan in scans]
    assert len(parts[0][0]) == QUANTILES.size
    for k, target in ((1, unseen.spectrum_along), (2, unseen.spectrum_across)):
        power = np.mean([part[k] for part in parts], axis=0)
        assert np.abs(decibels(power, np.array(target))).max() < 3.0
