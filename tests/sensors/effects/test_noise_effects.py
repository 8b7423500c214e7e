"""Effects on variance, tails, correlation and missing returns: realised against claimed."""

import math

import numpy as np
import pytest

from files.errors import RecipeError
from sensors.effects import CATALOGUE
from sensors.effects.anisotropic_lay import AnisotropicLay
from sensors.effects.empirical import Empirical
from sensors.effects.incidence_noise import IncidenceNoise
from sensors.effects.outlier_spikes import OutlierSpikes
from sensors.effects.random_dropout import RandomDropout
from sensors.effects.roughness_level import RoughnessLevel
from sensors.effects.specular_dropout import SpecularDropout
from sensors.law import geometric_law
from sensors.noise.lay import sample_lay
from sensors.noise.perlin import PerlinField
from sensors.view.view import Reason

FIELD = PerlinField(amplitude_mm=0.05, cell_x_mm=3.0, cell_y_mm=3.0, octaves=2)
DRAWS = 150


def streams(seed):
    return lambda name: np.random.default_rng([seed, *map(ord, name)])


def drawn(law, view, draws=DRAWS):
    return np.stack([law.sample(streams(seed), view)[0] for seed in range(draws)])


@pytest.mark.parametrize("name", CATALOGUE)
def test_realised_law_is_the_claimed_one(view_of, name):
    """Mean, deviation and missing share of many draws, against the law's, point by point."""
    y = np.linspace(-24.7, 24.6, 30)
    view = view_of("bench", sheet={"points_per_profile": 40, "z_resolution_um": 10.0}, y_mm=y)
    law = CATALOGUE[name].example().apply(geometric_law(view, FIELD), view)
    depths = drawn(law, view)
    seen = np.isfinite(law.mean_mm)
    assert np.isnan(depths[:, ~seen]).all()
    got = depths[:, seen]
    share = np.isnan(got).mean(axis=0)
    claimed = np.broadcast_to(law.p_missing, view.shape)[seen]
    assert np.abs(share - claimed).max() <= 6 * math.sqrt(0.25 / DRAWS)
    assert np.isclose(share.mean(), claimed.mean(), atol=0.02)
    often = share < 0.3
    core = law.sd_mm(view)[seen][often] ** 2 + law.step_mm**2 / 12
    tails = np.broadcast_to(law.p_outlier * np.square(law.outlier_sd_mm), view.shape)
    claimed_var = core + tails[seen][often]
    left = got[:, often]
    count = np.sum(np.isfinite(left), axis=0)
    error = (np.nanmean(left, axis=0) - law.mean_mm[seen][often]) / np.sqrt(claimed_var / count)
    assert np.abs(error).max() < 6
    assert np.isclose(np.mean(error**2), 1.0, atol=0.35)
    realised = np.nanvar(left, axis=0, ddof=1) / claimed_var
    assert np.isclose(realised.mean(), 1.0, atol=0.08)


@pytest.mark.parametrize("tilt", [0.0, 30.0, 50.0])
@pytest.mark.parametrize("exponent", [0.5, 1.0, 2.0])
def test_noise_grows_with_incidence(view_of, tilt, exponent):
    view = view_of("plate", solid={"tilt_y_deg": tilt})
    law = IncidenceNoise(exponent=exponent).apply(geometric_law(view, FIELD), view)
    assert np.allclose(law.speckle_gain, math.cos(math.radians(tilt)) ** -exponent)


def test_noise_may_depend_on_the_side(view_of):
    view = view_of("plate", solid={"tilt_y_deg": 30.0})
    turned = view_of("plate", solid={"tilt_y_deg": 30.0}, turned=True)
    effect = IncidenceNoise(exponent=0.0, lean=0.5)
    one, other = (effect.apply(geometric_law(v, FIELD), v).speckle_gain for v in (view, turned))
    slope = math.tan(math.radians(30.0))
    assert np.allclose(one, math.exp(-0.5 * slope))
    assert np.allclose(np.asarray(one) * other, 1.0)


def test_spikes_make_tails(view_of):
    view = view_of("plate", sheet={"points_per_profile": 400})
    law = OutlierSpikes(share=0.02, width_um=500.0).apply(geometric_law(view, None), view)
    residual = drawn(law, view, 5) - view.depth_mm
    sd = float(np.asarray(law.white_sd_mm))
    wide = np.abs(residual) > 6 * sd
    expected = 0.02 * math.erfc(6 * sd / math.hypot(0.5, sd) / math.sqrt(2))
    assert np.isclose(wide.mean(), expected, rtol=0.05)
    assert np.isclose(np.std(residual[wide]), 0.5, rtol=0.05)


def test_two_kinds_of_spikes_mix(view_of):
    view = view_of("plate")
    law = geometric_law(view, None)
    for share, width in ((0.01, 100.0), (0.02, 400.0)):
        law = OutlierSpikes(share=share, width_um=width).apply(law, view)
    assert np.isclose(law.p_outlier, 1 - 0.99 * 0.98)
    assert np.isclose(
        law.p_outlier * law.outlier_sd_mm**2, 0.01 * 0.1**2 + (law.p_outlier - 0.01) * 0.4**2
    )


@pytest.mark.parametrize("patch_mm", [0.0, 4.0])
def test_dropouts_have_their_share_and_patches(view_of, patch_mm):
    view = view_of("plate", sheet={"points_per_profile": 240}, y_mm=np.linspace(-30, 30, 241))
    effect = RandomDropout(share=0.2, patch_mm=patch_mm)
    law = effect.apply(geometric_law(view, None), view)
    lost = np.isnan(drawn(law, view, 20))
    assert np.isclose(lost.mean(), 0.2, atol=0.015)
    _, reason = law.sample(streams(0), view)
    assert set(np.unique(reason)) == {Reason.VALID, Reason.DROPOUT}
    beside = lost[:, 1:] & lost[:, :-1]
    together = beside.mean() / lost.mean()
    if patch_mm == 0:
        assert np.isclose(together, 0.2, atol=0.01)
    else:
        assert together > 0.8


@pytest.mark.parametrize("side", ["+y", "-y"])
def test_gloss_is_seen_where_normal_and_half_vector_meet(view_of, side):
    """The plate that halves the angle to the camera, 15°, mirrors the laser into it."""
    towards = 1 if side == "+y" else -1
    sheet = {"camera_side": side}
    effect = SpecularDropout(share=0.9, lobe_deg=5.0, matt=0.0, threshold=0.1, softness=0.1)

    def lost(tilt):
        # normals lean towards the camera where the plate falls along its direction
        view = view_of("plate", solid={"tilt_y_deg": -towards * tilt}, sheet=sheet)
        law = effect.apply(geometric_law(view, None), view)
        return view.half_vector_rad[30, 40], law.p_missing[30, 40]

    angle, missing = lost(15.0)
    assert np.isclose(angle, 0.0, atol=2e-3)
    assert missing < 1e-6
    angle, missing = lost(-15.0)
    assert np.isclose(angle, math.radians(30.0), atol=2e-3)
    assert np.isclose(missing, 0.9)
    for tilt in (5.0, 10.0, 20.0, 25.0):
        angle, missing = lost(tilt)
        log_signal = -((math.tan(angle) / math.tan(math.radians(5.0))) ** 2)
        expected = 0.9 / (1 + math.exp((log_signal - math.log(0.1)) / 0.1))
        assert np.isclose(missing, expected)


def test_too_much_light_is_lost_in_the_lobe(view_of):
    view = view_of("plate", solid={"tilt_y_deg": -15.0})
    strong = SpecularDropout(kind="strong", threshold=0.5, softness=0.1, matt=0.0)
    assert strong.apply(geometric_law(view, None), view).p_missing[30, 40] > 0.89
    away = view_of("plate", solid={"tilt_y_deg": 15.0})
    assert strong.apply(geometric_law(away, None), away).p_missing[30, 40] < 1e-3


def lengths(field_mm, pitch_mm):
    """Root mean square slope along x and y, a measure of 1 / correlation length."""
    return [np.std(np.diff(field_mm, axis=axis)) / pitch_mm for axis in (1, 0)]


def test_lay_draws_the_noise_out():
    field = PerlinField(amplitude_mm=1.0, cell_x_mm=4.0, cell_y_mm=4.0, octaves=1)
    x = np.arange(400) * 0.25
    plain = sample_lay(field, x, x, 1.0, 0.0, np.random.default_rng(0))
    assert np.isclose(plain.std(), field.sd(), rtol=0.1)
    for angle, along in ((0.0, 0), (math.pi / 2, 1)):
        drawn_out = sample_lay(field, x, x, 4.0, angle, np.random.default_rng(1))
        assert np.isclose(drawn_out.std(), field.sd(), rtol=0.1)
        slopes = lengths(drawn_out, 0.25)
        assert np.isclose(slopes[1 - along] / slopes[along], 4.0, rtol=0.15)
    slanted = sample_lay(field, x, x, 4.0, math.pi / 4, np.random.default_rng(2))
    gy, gx = np.gradient(slanted)
    tensor = np.cov(gx.ravel(), gy.ravel())
    values, vectors = np.linalg.eigh(tensor)
    assert np.isclose(math.sqrt(values[1] / values[0]), 4.0, rtol=0.15)
    assert np.allclose(np.abs(vectors[:, 0]), math.sqrt(0.5), atol=0.05)  # flattest along 45°
    assert vectors[0, 0] * vectors[1, 0] > 0


def test_lay_is_fixed_to_the_part(view_of):
    """Seen by a sensor turned by 90°, lay along the part's x runs along the travel."""
    view = view_of("plate", sheet={"points_per_profile": 120}, y_mm=np.linspace(-30, 30, 121))
    quarter = np.eye(4)
    quarter[:2, :2] = [[0, -1], [1, 0]]
    turned = view.posed(quarter @ view.poses)
    field = PerlinField(amplitude_mm=1.0, cell_x_mm=4.0, cell_y_mm=4.0, octaves=1)
    ratios = []
    for scan in (view, turned):
        law = AnisotropicLay(ratio=4.0, angle_deg=0.0).apply(geometric_law(scan, field), scan)
        slopes = lengths(law.sample(streams(1), scan)[0], 0.5)
        ratios.append(slopes[1] / slopes[0])
    assert ratios[0] > 2.5
    assert ratios[1] < 1 / 2.5


def test_level_scales_heights_and_peaks(view_of):
    view = view_of("plate", sheet={"points_per_profile": 400, "repeatability_um": 0.0})
    law = geometric_law(view, FIELD)
    twice = RoughnessLevel(amplitude=2.0).apply(law, view)
    assert twice.speckle == FIELD
    assert np.isclose(twice.speckle_gain, 2.0)
    finer = RoughnessLevel(amplitude=1.0, peaks=2.0).apply(law, view)
    assert finer.speckle is not None
    assert finer.speckle.cell_x_mm == FIELD.cell_x_mm / 2
    one, two = (drawn(each, view, 10) - view.depth_mm for each in (law, twice))
    assert np.isclose(two.std() / one.std(), 2.0, rtol=0.02)


def test_empirical_curve_in_each_channel(view_of):
    view = view_of("plate", solid={"tilt_x_deg": 20.0})
    law = geometric_law(view, FIELD)
    knots, values = (185.0, 200.0, 215.0), (0.0, 0.5, 0.0)
    curve = np.interp(view.depth_mm, knots, values)
    mean = Empirical(against="depth", knots=knots, values=values).apply(law, view)
    assert np.allclose(mean.mean_mm - view.depth_mm, 1e-3 * curve)
    noise = Empirical(against="depth", channel="variance", knots=knots, values=values)
    assert np.allclose(noise.apply(law, view).sd_mm(view), law.sd_mm(view) * np.exp(curve))
    missing = Empirical(against="depth", channel="missing", knots=knots, values=values)
    assert np.allclose(missing.apply(law, view).p_missing, curve)
    rows = Empirical(against="time", knots=(0.0, 0.5), values=(0.0, 10.0))
    expected = 0.010 * np.clip(view.time_s / 0.5, 0, 1)
    assert np.allclose(rows.signature(view), expected[:, None])


def test_empirical_refuses_what_makes_no_curve():
    for bad in (
        {"knots": [0.0, 0.0], "values": [1.0, 2.0]},
        {"knots": [0.0], "values": [1.0, 2.0]},
        {"knots": [0.0, 1.0], "values": [0.1, 2.0], "channel": "missing"},
        {"against": "the moon"},
    ):
        with pytest.raises(RecipeError, match=r"empirical"):
            Empirical.from_mapping({"name": "empirical", **bad})
