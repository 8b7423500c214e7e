"""Local relief against closed forms: planes, ISO 16610-21's transmission, missing readings."""

import numpy as np
import pytest

from pipeline.dataset.relief import local_relief, pitch_mm

PITCH = (0.2, 0.1)


def grid(n: int, m: int) -> tuple[np.ndarray, np.ndarray]:
    y, x = np.mgrid[:n, :m].astype(float)
    return y * PITCH[0], x * PITCH[1]


@pytest.mark.parametrize("cutoff_mm", [0.8, 2.5, 8.0, 25.0])
def test_a_tilted_plane_has_no_relief_whatever_is_missing(cutoff_mm: float) -> None:
    y, x = grid(90, 130)
    depth = 400 + 0.3 * y - 0.7 * x
    depth[20:45, 30:80] = np.nan
    depth[:, 100:103] = np.nan
    relief = local_relief(depth, PITCH, cutoff_mm)
    np.testing.assert_array_equal(np.isnan(relief), np.isnan(depth))
    assert np.nanmax(np.abs(relief)) < 1e-9


@pytest.mark.parametrize("wavelength_mm", [2.0, 4.0, 8.0])
def test_a_wave_passes_as_the_standard_says(wavelength_mm: float) -> None:
    """Roughness transmission of ISO 16610-21: 1 - exp(-pi (alpha cutoff / wavelength)^2)."""
    _, x = grid(200, 800)
    wave = 0.01 * np.sin(2 * np.pi * x / wavelength_mm)
    relief = local_relief(100 - wave, PITCH, 4.0)
    passed = 1 - np.exp(-np.log(2) * (4.0 / wavelength_mm) ** 2)
    middle = (slice(80, 120), slice(200, 600))
    slope = (relief[middle] * wave[middle]).sum() / (wave[middle] ** 2).sum()
    np.testing.assert_allclose(slope, passed, atol=0.02)


def test_nothing_read_is_no_relief() -> None:
    assert np.isnan(local_relief(np.full((5, 6), np.nan), PITCH)).all()
    lone = np.full((5, 6), np.nan)
    lone[2, 3] = 7.0
    assert local_relief(lone, PITCH)[2, 3] == 0.0


def test_pitch_is_the_path_and_the_spread_of_the_fan() -> None:
    poses = np.tile(np.eye(4), (5, 1, 1))
    poses[:, 1, 3] = np.arange(5) * 0.25
    scan = {
        "depth": np.full((5, 4), 100.0),
        "pose": poses,
        "ray_x_mm": np.zeros(4),
        "ray_slope": np.array([-0.3, -0.1, 0.1, 0.3]),
    }
    np.testing.assert_allclose(pitch_mm(scan), (0.25, 20.0))
