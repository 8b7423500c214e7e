"""Long waves of the noise: none beyond whitening, or as much as relief puts there."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.evidence.long_waves import LONG_WAVES, louder_waves, power_of_long_waves
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.settings import SETTINGS
from tests.support.effect_case import bench_workspace


def waves(shape: tuple[int, int], rng: np.random.Generator) -> np.ndarray:
    """White noise that is left of the longest twelve waves along each side; unit variance."""
    power = np.fft.fft2(rng.standard_normal(shape))
    down, right = (np.abs(np.fft.fftfreq(k, 1 / k)) for k in shape)
    field = np.fft.ifft2(power * (np.hypot(down[:, None], right) < 12)).real
    return np.asarray(field / field.std())


def with_noise(ws: Workspace, relief: float, seed: int = 1) -> Workspace:
    """Exact depths with white noise and, of so many deviations, relief of long waves."""
    rng, patches = np.random.default_rng(seed), []
    noise = replace(ws.noise, acf=np.zeros_like(ws.noise.acf))
    noise.acf[noise.lags] = 1.0
    for p in ws.patches:
        field = rng.standard_normal(p.shape) + relief * waves(p.shape, rng)
        patches.append(replace(p, depth_mm=p.plain_mm + noise.sd_mm * field))
    return Workspace.build(patches, noise)


def power(ws: Workspace) -> float:
    """Power of long waves."""
    found = louder_waves(ws, Model())
    assert found is not None
    return float(np.exp(2 * found.log))


def test_white_noise_has_no_more_power_in_long_waves() -> None:
    ws = bench_workspace("domes")
    found = [power(with_noise(ws, 0.0, seed=k)) for k in range(4)]
    assert max(found) < 1.5
    assert np.mean(found) < 1.25
    # what chance leaves of it doesn't count
    usual = {LONG_WAVES: np.eye(SETTINGS.rate_steps)[-1]}
    counted = [power_of_long_waves(with_noise(ws, 0.0, seed=k), Model(), usual) for k in range(4)]
    assert max(counted) <= max(found)
    assert min(counted) == 1.0
    assert sum(counted) < sum(found)


def test_relief_has_the_power_that_it_was_made_with() -> None:
    ws = bench_workspace("domes")
    n, m = ws.patches[0].shape
    # all its variance is in π 12² of n m waves
    wanted = 1 + 0.25**2 * n * m / (np.pi * 12**2)
    found = [power(with_noise(ws, 0.25, seed=k)) for k in range(4)]
    assert np.mean(found) == pytest.approx(wanted, rel=0.3)


def test_what_whole_profiles_and_columns_do_is_no_noise_of_long_waves() -> None:
    ws, moved = with_noise(bench_workspace("domes"), 0.0), []
    for p in ws.patches:
        n, m = p.shape
        along = np.sin(2 * np.pi * 4 * np.arange(n) / n)[:, None]
        across = np.cos(2 * np.pi * 3 * np.arange(m) / m)[None]
        moved.append(replace(p, depth_mm=p.depth_mm + 0.3 * ws.noise.sd_mm * (along + across)))
    # each of the two waves has the power of 160 others
    assert power(Workspace.build(moved, ws.noise)) < 1.2 * power(ws)


def test_slips_of_profiles_are_no_noise_of_long_waves() -> None:
    """Lost counts were taken for noise, and what showed them for what is usual."""
    ws, moved = with_noise(bench_workspace("domes"), 0.0), []
    for p in ws.patches:
        slip_mm = 0.1 * np.linspace(-1, 1, p.shape[0]) ** 3
        depth = p.depth_mm + slip_mm[:, None] * np.nan_to_num(p.view.slope_y)
        moved.append(replace(p, depth_mm=depth))
    slipped = Workspace.build(moved, ws.noise)
    assert power(slipped) > 2.5
    still = louder_waves(slipped, Model(), {"slope_y"})
    assert still is not None
    assert np.exp(2 * still.log) < 1.5


def test_what_no_good_instrument_has_in_long_waves_is_no_noise() -> None:
    ws = with_noise(bench_workspace("domes"), 0.5)
    sizes = SETTINGS.rate_sizes()
    assert power(ws) > 2
    for most in (2, 3):
        usual = {LONG_WAVES: np.eye(sizes.size)[most]}
        found = power_of_long_waves(ws, Model(), usual)
        assert found == pytest.approx(np.exp(2 * sizes[most]), rel=0.02)
    # a good instrument that has more of it than this
    usual = {LONG_WAVES: np.full(sizes.size, 1 / sizes.size)}
    assert power_of_long_waves(ws, Model(), usual) == pytest.approx(power(ws), rel=0.02)
