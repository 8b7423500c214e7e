"""Roughness figures, form removal and spectra: closed forms, real profiles, other people's code."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import find_peaks

from sensors.noise.spectrum import band_edges, band_power, decibels, power_spectrum
from sensors.surface.form import GAUSSIAN_ALPHA, remove_form, remove_line, remove_plane, waviness
from sensors.surface.roughness import FEWEST_POINTS, FIGURES, profile_roughness, roughness

X = np.arange(20_000) * 0.01


def test_sine() -> None:
    found = roughness(3.0 * np.sin(2.0 * np.pi * 0.5 * X), 0.01)
    assert found.ra_mm == pytest.approx(3.0 * 2.0 / math.pi, rel=1e-3)
    assert found.rq_mm == pytest.approx(3.0 / math.sqrt(2.0), rel=1e-3)
    for value in (found.rp_mm, found.rv_mm, found.rpm_mm, found.rvm_mm):
        assert value == pytest.approx(3.0, rel=1e-3)
    assert found.pc_per_mm == pytest.approx(0.5, rel=1e-3)


def test_triangle() -> None:
    found = roughness(np.abs((0.2 * X) % 2.0 - 1.0), 0.01)  # 0 to 1, period 10 mm
    assert found.ra_mm == pytest.approx(0.25, rel=1e-3)
    assert found.rq_mm == pytest.approx(0.5 / math.sqrt(3.0), rel=1e-3)
    assert found.rp_mm == pytest.approx(0.5, rel=1e-2)
    assert found.pc_per_mm == pytest.approx(0.1, rel=0.06)


def test_white_gaussian_noise() -> None:
    found = roughness(np.random.default_rng(1).normal(size=(2000, 501)), 1.0)
    assert found.ra_mm / found.rq_mm == pytest.approx(math.sqrt(2.0 / math.pi), rel=2e-3)
    assert found.pc_per_mm == pytest.approx(1.0 / 3.0, rel=0.01)
    # largest of 501: the median of the maximum is where Φ^501 = 1/2, its mean 0.06 above
    assert found.rp_mm == pytest.approx(3.0 + 0.05, abs=0.04)
    assert found.rp_mm == pytest.approx(found.rv_mm, rel=0.01)


def test_peaks_of_a_correlated_gaussian_process_follow_rice() -> None:
    """Maxima per length: sqrt(m4/m2)/2π of the spectral moments (Rice 1944)."""
    rng = np.random.default_rng(2)
    n, width = 2**16, 12.0
    f = np.fft.rfftfreq(n)
    spectrum = np.exp(-0.5 * (2.0 * np.pi * f * width) ** 2)
    noise = np.fft.irfft(np.fft.rfft(rng.normal(size=(4, n))) * np.sqrt(spectrum), n)
    m2, m4 = np.sum(spectrum * (2 * np.pi * f) ** 2), np.sum(spectrum * (2 * np.pi * f) ** 4)
    assert roughness(noise, 0.5).pc_per_mm == pytest.approx(
        math.sqrt(m4 / m2) / (2 * np.pi) / 0.5, rel=0.03
    )


@given(st.floats(1e-3, 1e3), st.floats(-100.0, 100.0), st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None)
def test_scale_and_offset_only_scale(scale: float, offset: float, seed: int) -> None:
    z = np.random.default_rng(seed).normal(size=(3, 80))
    a, b = roughness(z, 0.1), roughness(scale * z + offset * scale, 0.1)
    np.testing.assert_allclose(b.values()[:6], scale * a.values()[:6], rtol=1e-9)
    assert b.pc_per_mm == pytest.approx(a.pc_per_mm)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None)
def test_upside_down_swaps_peaks_and_valleys(seed: int) -> None:
    z = np.random.default_rng(seed).normal(size=(2, 300))
    up, down = roughness(z, 1.0), roughness(-z, 1.0)
    assert (down.rp_mm, down.rpm_mm) == pytest.approx((up.rv_mm, up.rvm_mm))
    assert up.rpm_mm <= up.rp_mm


def test_extremes_and_maxima_are_those_of_numpy_and_scipy() -> None:
    z = np.random.default_rng(3).normal(size=(40, 501))
    each = profile_roughness(z, 1.0)
    for row, found in zip(z, each, strict=True):
        row = row - row.mean()
        peaks = find_peaks(row, prominence=0.01 * row.std())[0]
        assert found[6] * row.size == pytest.approx(peaks.size, abs=2)  # ends differ
        assert found[4] == pytest.approx(np.sort(row)[-10:].mean(), rel=1e-12)
        assert found[5] == pytest.approx(-np.sort(row)[:10].mean(), rel=1e-12)


def test_pc_with_the_height_rule_counts_what_stands_out() -> None:
    ripple = np.sin(2 * np.pi * X) + 0.045 * np.sin(2 * np.pi * 23.3 * X)
    assert roughness(ripple, 0.01).pc_per_mm > 12.0
    assert roughness(ripple, 0.01, peak_height_share=0.1).pc_per_mm == pytest.approx(1.0, rel=0.01)


def test_plateaus_count_once_and_tilt_makes_no_peaks_of_steps() -> None:
    profile = np.repeat([0.0, 1.0, 2.0, 1.0, 0.0], 8)
    assert roughness(np.tile(profile, 5), 1.0).pc_per_mm * 200 == pytest.approx(5)
    stairs = np.round(np.random.default_rng(4).normal(size=(20, 500)).cumsum(axis=1) / 3.0)
    level = roughness(stairs, 1.0).pc_per_mm
    tilted = roughness(stairs - 1e-4 * np.arange(500), 1.0).pc_per_mm
    assert tilted == pytest.approx(level, rel=1e-6)


def test_missing_readings_change_figures_little_and_hide_no_profile() -> None:
    rng = np.random.default_rng(5)
    z = rng.normal(size=(400, 501))
    holes = np.where(rng.random(z.shape) < 0.02, np.nan, z)
    whole, with_holes = roughness(z, 1.0), roughness(holes, 1.0)
    np.testing.assert_allclose(with_holes.values()[:6], whole.values()[:6], rtol=0.02)
    assert with_holes.pc_per_mm == pytest.approx(whole.pc_per_mm, rel=0.08)
    holes[3, FEWEST_POINTS - 1 :] = np.nan
    assert np.isnan(profile_roughness(holes, 1.0)[3]).all()
    with pytest.raises(ValueError, match="no profile"):
        roughness(np.full((3, 50), np.nan), 1.0)


def test_instruments_own_report_of_a_stylus_profile(shared_dir: Path) -> None:
    """Mitutoyo's Ra 3.308, Rq 3.959, Rp 8.244, Rv 10.240 (four sections, no mean removed)."""
    table = np.loadtxt(
        shared_dir / "real/roughness/mitutoyo_2_profile_x_mm_z_um.csv", delimiter=",", skiprows=1
    )
    pitch = float(np.median(np.diff(table[:, 0])))
    assert round(2.5 / pitch) == 1667
    sections = table[: 4 * 1666, 1].reshape(4, 1666)
    each = profile_roughness(sections, pitch)
    # the report's mean line is zero: nothing is taken out
    means = sections.mean(axis=1)
    assert np.abs(sections).mean() == pytest.approx(3.308, abs=1e-3)
    assert np.mean(each[:, 0]) == pytest.approx(3.308, rel=5e-3)
    assert np.mean(each[:, 2] + means) == pytest.approx(8.244, abs=2e-3)
    assert np.mean(each[:, 3] - means) == pytest.approx(10.240, abs=2e-3)
    assert np.mean(np.hypot(each[:, 1], means)) == pytest.approx(3.959, abs=2e-3)


@pytest.mark.filterwarnings("ignore::DeprecationWarning:SurfaceTopography")
@pytest.mark.filterwarnings("ignore:Function/property .* is deprecated")
@pytest.mark.parametrize("name", ["x3p-2.x3p", "sur-2.sur"])
def test_rq_and_spectrum_are_those_of_surface_topography(shared_dir: Path, name: str) -> None:
    surface_topography = pytest.importorskip("SurfaceTopography")
    topography = surface_topography.open_topography(shared_dir / "real/roughness" / name)
    topography = topography.topography()
    heights = np.ma.filled(topography.heights().astype(float), np.nan).T
    rows = [row for row in heights[::40] if np.isfinite(row).all()]
    length = topography.physical_sizes[0]
    pitch = length / rows[0].size
    for row in rows:
        scan = surface_topography.UniformLineScan(row, length)
        level = scan.detrend(detrend_mode="height")
        ours = remove_line(row)
        found = roughness(ours, pitch)
        assert found.rq_mm == pytest.approx(level.rms_height_from_profile(), rel=2e-3)
        _, theirs = level.power_spectrum_from_profile(window="hann", resampling_method=None)
        _, density = power_spectrum(ours, pitch, 1)
        lines = theirs.size - 2
        for band in np.array_split(np.arange(lines), 12):  # theirs is two-sided
            ratio = density[band].sum() / theirs[1:-1][band].sum()
            assert ratio == pytest.approx(2.0, rel=0.05)


def test_gaussian_filter_passes_half_at_the_cutoff() -> None:
    for wavelength in (0.4, 0.8, 2.5):
        sine = np.sin(2 * np.pi * X / wavelength)[None, :]
        mean_line = waviness(sine, 0.01, 0.8)
        middle = slice(5000, 15_000)
        share = mean_line[0, middle] @ sine[0, middle] / (sine[0, middle] @ sine[0, middle])
        expected = math.exp(-math.pi * (GAUSSIAN_ALPHA * 0.8 / wavelength) ** 2)
        assert share == pytest.approx(expected, abs=2e-3)
    assert math.exp(-math.pi * GAUSSIAN_ALPHA**2) == pytest.approx(0.5)


def test_gaussian_filter_keeps_a_constant_at_ends_and_gaps_and_either_axis() -> None:
    z = np.full((40, 30), 2.5)
    z[5:9, 3:6] = np.nan
    for axis in (0, 1):
        mean_line = waviness(z, 0.1, 5.0, axis)
        assert mean_line.shape == z.shape
        np.testing.assert_allclose(mean_line[np.isfinite(mean_line)], 2.5)
    np.testing.assert_allclose(waviness(z.T, 0.1, 5.0, 0), waviness(z, 0.1, 5.0, 1).T)


def test_line_and_plane_come_out_with_gaps_left_as_they_are() -> None:
    rng = np.random.default_rng(6)
    row, column = np.indices((30, 50))
    noise = rng.normal(size=(30, 50))
    holes = rng.random((30, 50)) < 0.1
    plane = np.where(holes, np.nan, 3.0 + 0.2 * row - 0.7 * column)
    np.testing.assert_allclose(remove_plane(plane)[~holes], 0.0, atol=1e-10)
    np.testing.assert_allclose(remove_line(plane)[~holes], 0.0, atol=1e-10)
    assert np.isnan(remove_line(plane)[holes]).all()
    x = np.arange(50)
    lines = [np.polyval(np.polyfit(x, profile, 1), x) for profile in noise]
    np.testing.assert_allclose(remove_line(noise), noise - lines, atol=1e-10)
    with pytest.raises(ValueError, match="span"):
        remove_plane(np.ones((1, 50)))
    with pytest.raises(ValueError, match="form is"):
        remove_form(noise, 0.1, form="cubic")


def test_spectrum_of_white_noise_is_flat_and_sums_to_the_variance() -> None:
    z = np.random.default_rng(7).normal(size=(3000, 128)) * 2.0
    for axis, values in ((1, z), (0, z.T)):
        frequency, density = power_spectrum(values, 0.5, axis)
        assert frequency[-1] == pytest.approx(1.0)
        np.testing.assert_allclose(density[1:-1], 2.0 * 4.0 * 0.5, rtol=0.15)
        assert density.sum() * frequency[0] == pytest.approx(4.0, rel=0.03)


def test_bands_hold_every_line_between_their_ends_once() -> None:
    frequency = np.arange(1, 101) * 0.05
    edges = band_edges(0.4, 5.0, 100)
    power = band_power(frequency, np.ones(100), edges)
    assert np.isfinite(power).all()
    np.testing.assert_allclose(power, 1.0)
    assert edges[0] == 0.4
    assert edges[-1] == 5.0
    assert decibels(np.array([2.0]), np.array([1.0]))[0] == pytest.approx(3.0103, abs=1e-4)


def test_figures_are_named_in_the_papers_order() -> None:
    assert FIGURES == (
        "ra_mm", "rq_mm", "rp_mm", "rv_mm", "rpm_mm", "rvm_mm", "pc_per_mm"
    )  # fmt: skip
