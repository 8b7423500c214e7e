"""Light that sinks into the part or lands on it twice, against closed forms."""

import dataclasses
import math

import numpy as np
import pytest

from sensors.effects.interreflection import Interreflection
from sensors.effects.volume_scattering import VolumeScattering
from sensors.law import geometric_law

COT = 1 / math.tan(math.radians(30.0))


@pytest.mark.parametrize("side", ["+y", "-y"])
def test_groove_mirrors_the_spot_across(view_of, side):
    """45° walls send the ray level across: Q lies at -y of the groove, at the same depth."""
    y = np.array([-6.0, -2.0, 2.0, 6.0])
    view = view_of("groove", sheet={"camera_side": side}, y_mm=y)
    depth = 220.0 - np.abs(y)
    assert np.allclose(view.depth_mm[:, 40], depth)
    assert np.allclose(view.mirror.distance_mm[:, 40], 2 * np.abs(y), atol=1e-4)
    base = 200.0 / COT * (1 if side == "+y" else -1)
    apparent = depth / (1 + 2 * y / base)  # Q at sensor y = -2 y of the profile
    assert np.allclose(view.mirror.landed_mm[:, 40], apparent, atol=1e-4)
    # Lambert: as bright as the cosine to the camera, of the walls' normals (0, ∓1, -1) / √2
    first = (depth - np.sign(y) * base) / np.hypot(base, depth)
    second = (depth + np.sign(y) * (base + 2 * y)) / np.hypot(base + 2 * y, depth)
    light = view.mirror.landed_light[:, 40]
    # seen from nearer, spots lie closer in the columns, which they share in pairs
    assert np.allclose(light, second / first * (1 + 2 * y / base), rtol=0.06)
    for power in (1.0, 2.0):
        effect = Interreflection(weight=0.1, reach_mm=5.0, power=power, contrast=0.3)
        fallen = (2 * np.abs(y) / 5.0) ** power
        ratio = 0.1 * np.exp(-fallen) * light
        pull = ratio / (1 + ratio) * (apparent - depth)
        assert np.allclose(effect.signature(view)[:, 40], pull, atol=1e-5)
        # the logarithm of the ratio scatters by both spots' brightness
        scatter = 0.3 * np.sqrt(1 + np.exp(fallen)) * np.abs(pull) / (1 + ratio)
        bare = geometric_law(view, None)
        noisier = effect.apply(bare, view).white_sd_mm[:, 40]
        assert np.allclose(noisier, np.hypot(bare.white_sd_mm, scatter), atol=1e-5)
        faint = Interreflection(weight=1e-4, reach_mm=5.0, power=power)
        assert np.allclose(1e-4 * faint.fields(view)[0], faint.signature(view), atol=1e-6)


def test_second_spot_pulls_the_column_in_which_it_is_seen(view_of):
    """A 45° wall beside an upright one sends every second spot into the column at the wall."""
    view = view_of("corner", sheet={"points_per_profile": 121}, y_mm=[-1.0, 0.0, 1.0])
    x = view.part_mm[1, :, 0]
    on_slope = (x > -9.9) & (x < 9.9)
    assert np.allclose(view.mirror.distance_mm[1][on_slope], 10.0 - x[on_slope], atol=1e-3)
    pulled = np.isfinite(view.mirror.landed_mm[1])
    assert np.allclose(x[pulled], 10.0, atol=0.5)
    assert np.all(Interreflection(weight=0.3).signature(view)[1][on_slope] == 0.0)


def test_strong_reflection_makes_the_reading_jump(view_of):
    view = view_of("groove", y_mm=np.array([6.0, 1.0]))
    # the facing wall turns to the camera: its spot may be the brighter one
    light = view.mirror.landed_light[1, 40] * np.exp(-2 / 5.0)
    pull = (view.mirror.landed_mm - view.depth_mm)[1, 40]
    for weight, jumps in ((0.95 / light, 0.0), (1.05 / light, pull)):
        effect = Interreflection(weight=weight, reach_mm=5.0, kind="jump")
        change = effect.signature(view)[:, 40]
        assert change[0] == 0.0
        assert np.isclose(change[1], jumps)


def test_flats_have_no_facing_wall(view_of):
    view = view_of("plate", sheet={"columns": "even_angle"})
    assert np.isnan(view.mirror.distance_mm).all()
    assert np.all(Interreflection(weight=0.5).signature(view) == 0.0)


def test_light_sinks_by_the_free_path_as_it_seems(view_of):
    for thickness, depth_um in ((20.0, 80.0), (0.1, 80.0), (0.05, 300.0)):
        view = view_of("plate", solid={"thickness": thickness})
        assert np.allclose(view.thickness_mm, thickness, atol=1e-5)
        middle = np.argmin(np.abs(view.column_x_mm))
        sunk = VolumeScattering(depth_um=depth_um, index=1.5).signature(view)[:, middle]
        d = depth_um * 1e-3
        # hit squarely: apparent depth
        assert np.allclose(sunk, d * (1 - math.exp(-thickness / d)) / 1.5, rtol=2e-3)
    # without refraction light goes on along the ray
    view = view_of("plate", solid={"tilt_y_deg": 40.0})
    straight = VolumeScattering(depth_um=80.0, index=1.0).signature(view)
    assert np.allclose(straight, 0.080 * view.ray[:, 2], rtol=1e-6)


@pytest.mark.parametrize("tilt_deg", [-40.0, -15.0, 15.0, 40.0])
def test_sunken_light_is_triangulated_as_snell_bends_it(view_of, tilt_deg):
    view = view_of("plate", solid={"tilt_y_deg": tilt_deg})
    sunk = VolumeScattering(depth_um=80.0, index=1.5).signature(view)
    middle = np.argmin(np.abs(view.column_x_mm))
    normal = view.normal[0, middle]
    beta = math.acos(-normal[2])
    inside = math.asin(math.sin(beta) / 1.5)
    # along the inward normal and along the surface: the way's normal part looks shorter by n
    deep, aside = math.cos(inside) / 1.5, math.sin(inside)
    tangent = np.array([0.0, math.copysign(math.cos(beta), -normal[1]), 0.0])
    tangent[2] = math.sin(beta)
    place = -deep * normal + aside * np.array([0.0, -tangent[1], tangent[2]])
    depth = view.depth_mm[:, middle]
    read = place[2] + place[1] * depth / view.datasheet.camera_offset_mm
    assert np.allclose(sunk[:, middle], 0.080 * read, rtol=5e-3)


@pytest.mark.parametrize("columns", ["even_x", "even_angle"])
@pytest.mark.parametrize("tilt_deg", [-40.0, -15.0, 15.0, 40.0])
def test_a_column_reads_light_that_came_in_beside_it(view_of, tilt_deg, columns):
    view = view_of("plate", solid={"tilt_x_deg": tilt_deg}, sheet={"columns": columns})
    way, index = 0.080, 1.5
    sunk = VolumeScattering(depth_um=1e3 * way, index=index).signature(view)[0]
    # shift every ray's own image, then find what the columns see of the shifted plane
    normal, ray = view.normal[0], view.ray
    cosine = -np.sum(normal * ray, axis=1)
    inside = np.sqrt(1 - (1 - cosine**2) / index**2)
    image = view.sensor_mm[0] + way * (ray + (cosine - inside)[:, None] * normal) / index
    base = view.datasheet.camera_offset_mm
    read = image[:, 2] + image[:, 1] * image[:, 2] / base
    fan = columns == "even_angle"
    column = image[:, 0] / image[:, 2] if fan else image[:, 0]
    seen = np.interp(view.laser.slope_x if fan else view.laser.x_mm, column, read)
    middle = slice(20, -20)
    assert np.allclose(seen[middle] - view.depth_mm[0][middle], sunk[middle], atol=3e-4)
    assert np.abs(sunk[middle]).max() > 0.05


def test_sunken_light_of_two_faces_is_averaged_by_the_line(view_of):
    """At a groove's bottom both walls sink by their own amounts; far from it each by its own."""
    y = np.array([-10.0, -8.0, 0.0, 8.0, 10.0])
    effect = VolumeScattering(depth_um=80.0)
    line = effect.signature(view_of("groove", y_mm=y))[:, 40]
    thin = effect.signature(view_of("groove", y_mm=y, sheet={"line_width_um": None}))[:, 40]
    assert np.allclose(line[[0, 1, 3, 4]], thin[[0, 1, 3, 4]], rtol=1e-6)
    assert abs(thin[1] - thin[3]) > 0.02
    # the walls differ a little with the depth at which they are hit
    assert line[2] == pytest.approx(0.5 * (thin[1] + thin[3]), abs=2e-3)


def test_thick_basis_is_the_effect(view_of):
    view = view_of("plate")
    effect = VolumeScattering(depth_um=80.0)
    basis = effect.basis(view)
    assert basis is not None
    assert np.allclose(basis.fields[0] * 80.0, effect.signature(view))
    twice = effect.with_coefficients(np.array([160.0]))
    assert dataclasses.replace(effect, depth_um=160.0) == twice
