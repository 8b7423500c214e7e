"""Effects of the line's width and of what the camera sees of it, against closed forms."""

import math

import numpy as np
import pytest
from scipy.special import ndtri

from sensors.effects.camera_occlusion import CameraOcclusion
from sensors.effects.edge_mixing import EdgeMixing
from sensors.effects.finite_spot import FiniteSpot
from sensors.effects.motion_blur import MotionBlur
from sensors.effects.reflectance_edge import ReflectanceEdge
from sensors.effects.specular_dropout import SpecularDropout
from sensors.law import geometric_law
from sensors.line.lambertian_light import lambertian_light
from sensors.line.line_operator import SUB_LINES, gaussian_weights, line_mean, read_line, sub_lines
from sensors.model import as_wide
from sensors.surface.reflectance import Patch, ReflectanceMap
from sensors.view.view import Reason

COT = 1 / math.tan(math.radians(30.0))


FINE = np.linspace(-1.0, 1.0, 41)


def hidden(view, effect):
    return effect.apply(geometric_law(view, None), view).reason == Reason.HIDDEN_FROM_CAMERA


@pytest.mark.parametrize("height", [3.0, 10.0])
@pytest.mark.parametrize("angle_deg", [15.0, 30.0])
@pytest.mark.parametrize(("side", "turned"), [("+y", False), ("-y", False), ("+y", True)])
def test_shadow_beside_a_step(view_of, height, angle_deg, side, turned):
    """The block's edge hides the floor from the camera over h·b/z, z the floor's depth."""
    y = np.linspace(-25, 25, 401)
    view = view_of(
        "step", solid={"height": height}, sheet={"camera_side": side}, turned=turned, y_mm=y
    )
    shade = hidden(view, CameraOcclusion(triangulation_angle_deg=angle_deg))[:, 40]
    base = 200.0 * math.tan(math.radians(angle_deg))
    # the sight line from (y, floor) to the camera at y + b grazes the edge at height h
    length = height * base / 200.0
    assert np.isclose(shade.sum() * (y[1] - y[0]), length, atol=1.01 * (y[1] - y[0]))
    camera_towards_plus = (side == "+y") != turned
    inside = y[shade]
    if camera_towards_plus:
        assert -10.0 - length - 0.13 <= inside.min() < inside.max() <= -10.0
    else:
        assert 10.0 <= inside.min() < inside.max() <= 10.0 + length + 0.13


@pytest.mark.parametrize("weakest", [0.1, 0.5, 0.9])
def test_shadow_of_a_line_with_a_width(view_of, weakest):
    """Returns end where the camera sees less of the line: further out the more it must see."""
    y = np.linspace(-18, -14, 401)  # the shadow of 10 mm ends at -10 - 10 tan 30° = -15.774
    view = view_of("step", y_mm=y)
    shade = hidden(view, CameraOcclusion(line_sd_um=300.0, weakest=weakest))[:, 40]
    border = y[shade].min()
    expected = -10 - 10 / COT - 0.3 * float(ndtri(weakest))
    assert np.isclose(border, expected, atol=0.09)  # sub-lines stand 0.15 mm apart


def test_driving_backwards_leaves_shadows_in_place(view_of):
    y = np.linspace(-25, 25, 101)
    forth, back = view_of("step", y_mm=y), view_of("step", y_mm=y[::-1])
    assert np.array_equal(hidden(forth, CameraOcclusion()), hidden(back, CameraOcclusion())[::-1])


def test_sub_lines_have_the_lines_moments():
    offsets = sub_lines(0.06)
    weights = np.array(gaussian_weights(offsets, 0.06))
    assert len(offsets) == SUB_LINES
    assert np.isclose(weights @ offsets, 0.0, atol=1e-15)
    assert np.isclose(weights @ offsets**2 / weights.sum(), 0.06**2, rtol=1e-12)
    half = offsets > 0
    mean = weights[half] @ offsets[half] / weights[half].sum()
    assert np.isclose(mean, 0.06 * math.sqrt(2 / math.pi), rtol=0.02)


@pytest.mark.parametrize("sd_um", [100.0, 300.0])
def test_spot_on_a_cylinder_sinks_by_half_s_squared_over_radius(view_of, sd_um):
    view = view_of("cylinder", solid={"radius": 30.0}, y_mm=FINE)
    bias = FiniteSpot(line_sd_um=sd_um).signature(view)[20, 40]
    assert np.isclose(bias, (sd_um * 1e-3) ** 2 / (2 * 30.0), rtol=0.02)


def test_spot_along_the_line_doesnt_see_curvature_across_it(view_of):
    view = view_of("cylinder", y_mm=FINE)
    along = FiniteSpot(line_sd_um=1e-9, along_um=300.0).signature(view)
    assert np.nanmax(np.abs(along[:, 5:-5])) < 1e-9


@pytest.mark.parametrize("tilt", [20.0, 45.0])
def test_uniform_tilted_plane_has_no_bias(view_of, tilt):
    view = view_of("plate", solid={"tilt_y_deg": tilt, "tilt_x_deg": 10.0}, y_mm=FINE)
    for effect in (FiniteSpot(line_sd_um=200.0), EdgeMixing(line_sd_um=200.0)):
        assert np.abs(effect.signature(view)).max() < 1e-12
    line = read_line(view, sub_lines(0.2), gaussian_weights(sub_lines(0.2), 0.2), camera=True)
    # κ η cot θ times a slope leaves second order in s / z only
    assert np.abs(line.depth_mm - view.depth_mm).max() < 0.2**2 / 100


def test_spot_grows_with_defocus(view_of):
    near = view_of("cylinder", y_mm=FINE, height_mm=200.0)
    far = view_of("cylinder", y_mm=FINE, height_mm=220.0)
    effect = FiniteSpot(line_sd_um=100.0, rayleigh_mm=20.0)
    ratio = effect.signature(far)[20, 40] / effect.signature(near)[20, 40]
    assert np.isclose(ratio, 2.0, rtol=0.05)


@pytest.mark.parametrize(("side", "sign"), [("+y", 1), ("-y", -1)])
def test_half_a_line_reads_080_s_cot(view_of, side, sign):
    """At the part's end only the half of the line on the part is left."""
    s = 0.06
    ends = np.array([-10.0, 10.0])
    view = view_of("end", sheet={"camera_side": side}, y_mm=ends + [1e-6, -1e-6])
    change = EdgeMixing(line_sd_um=60.0).signature(view)[:, 40]
    expected = sign * s * math.sqrt(2 / math.pi) * COT
    assert np.isclose(abs(expected), 0.083, atol=5e-4)  # 83 µm at s = 60 µm
    assert np.allclose(change, [expected, -expected], rtol=0.03)


def test_edge_error_changes_sign_when_the_sensor_is_turned(view_of):
    y = np.array([-9.99, 9.99])
    one = EdgeMixing(line_sd_um=60.0).signature(view_of("end", y_mm=y))
    turned = EdgeMixing(line_sd_um=60.0).signature(view_of("end", y_mm=y, turned=True))
    assert np.all(np.abs(one) > 0.02)
    assert np.allclose(turned, -one, rtol=0.01)


def test_far_from_edges_nothing_is_mixed(view_of):
    view = view_of("step", y_mm=np.linspace(-25, 25, 101))
    away = np.abs(np.abs(-view.poses[:, 1, 3]) - 10.0) > 8.0
    assert np.all(EdgeMixing(line_sd_um=300.0).signature(view)[away, 40] == 0.0)


def test_peaks_merge_or_the_brighter_wins(view_of):
    """On the lower side of a small step, seen from the camera's side, both levels are seen."""
    y = np.array([10.05])  # 50 µm beside the block, towards the camera at +y
    view = view_of("step", solid={"height": 0.5}, sheet={"camera_side": "+y"}, y_mm=y)
    assert np.isclose(view.depth_mm[0, 40], 200.0)
    merged = EdgeMixing(line_sd_um=100.0, merge_um=2000.0).signature(view)[0, 40]
    apart = EdgeMixing(line_sd_um=100.0, merge_um=0.0).signature(view)[0, 40]
    block = 0.5 * math.erfc(0.5 / math.sqrt(2))  # share of the line's light on the block
    assert np.isclose(merged, -0.5 * block, atol=0.04)
    floor_centre = 0.1 * math.exp(-0.125) / math.sqrt(2 * math.pi) / (1 - block)
    assert np.isclose(apart, floor_centre * 200.0 / (200.0 / COT), atol=0.02)


@pytest.mark.parametrize(("ratio", "expected_um"), [(0.5, 28.0), (0.2, 55.0), (0.1, 68.0)])
def test_brightness_edge_reads_as_a_ridge(view_of, ratio, expected_um):
    """κ s √(2/π) (1-r)/(1+r) cot θ: 28, 55, 68 µm at s = 60 µm."""
    dark = Patch(value=ratio * 0.8, x_mm=(-100.0, 100.0), y_mm=(0.0, 100.0))
    bright = ReflectanceMap(base=0.8, patches=(dark,))
    far, at_edge = np.array([-5.0, 5.0]), np.array([0.0])
    for side, sign in (("+y", 1), ("-y", -1)):
        sheet = {"camera_side": side}
        effect = ReflectanceEdge(line_sd_um=60.0)
        view = view_of("plate", sheet=sheet, y_mm=at_edge, reflectance=bright)
        # the bright side lies at -y: it pulls to where the camera isn't, and reads nearer
        assert np.isclose(effect.signature(view)[0, 40] * 1e3, -sign * expected_um, rtol=0.03)
        flat = view_of("plate", sheet=sheet, y_mm=far, reflectance=bright)
        assert np.abs(effect.signature(flat)).max() < 1e-12


@pytest.mark.parametrize("angle_deg", [0.0, 30.0, 50.0])
def test_a_footprint_along_the_line_softens_a_border_that_runs_askew(view_of, angle_deg):
    """A border at φ to the line pulls by s/√(s² + w² tan² φ) of what it does along it."""

    class Askew:
        cell_mm = 0.0

        def at(self, part_mm):
            beyond = part_mm[..., 1] - math.tan(math.radians(angle_deg)) * part_mm[..., 0]
            return np.where(beyond > middle, 0.2, 1.0)

    effect = ReflectanceEdge(line_sd_um=60.0)
    spot = {"name": "finite_spot", "line_sd_um": 60.0, "along_um": 50.0}
    near = np.linspace(-0.014, 0.014, 15)  # sub-lines stand 0.03 mm apart
    x = view_of("plate", y_mm=[0.0]).part_mm[0, 40, 0]
    middle = -math.tan(math.radians(angle_deg)) * x
    pulls = []
    for listed in ((), (spot,)):
        view = view_of("plate", sheet={"effects": listed}, y_mm=near, reflectance=Askew())
        pulls.append(effect.signature(view)[:, 40].mean())
    smeared = 50.0 * math.tan(math.radians(angle_deg))
    assert np.isclose(pulls[1] / pulls[0], 60.0 / math.hypot(60.0, smeared), rtol=0.03)


def test_a_footprint_is_presumed_only_where_a_print_is_known_and_none_is_told(view_of):
    spot = {"name": "finite_spot", "line_sd_um": 60.0, "along_um": 50.0}
    edge, printed = ReflectanceEdge(line_sd_um=60.0), ReflectanceMap(base=0.8)
    view = view_of("plate", reflectance=printed)
    (wider,) = edge.variants(view)
    pitch_um = 1e3 * np.median(np.abs(np.diff(view.column_x_mm)))
    assert np.isclose(wider.along_um, pitch_um / math.sqrt(12))  # a column's even share
    assert wider.variants(view) == ()
    assert edge.variants(view_of("plate")) == ()
    assert edge.variants(view_of("plate", sheet={"effects": (spot,)}, reflectance=printed)) == ()


def test_brightness_gradient_from_a_recordings_intensity(view_of):
    """κ s² cot θ ∂y ln I, with I linear between profiles."""
    y = np.linspace(-2.0, 2.0, 41)
    intensity = np.repeat(np.exp(0.5 * y)[:, None], 80, axis=1) / 3
    view = view_of("plate", y_mm=y, intensity=intensity)
    bias = ReflectanceEdge(line_sd_um=100.0).signature(view)[20, 40]
    assert np.isclose(bias, 0.1**2 * COT * 0.5, rtol=0.02)
    back = view_of("plate", y_mm=y[::-1], intensity=intensity[::-1])
    assert np.isclose(ReflectanceEdge(line_sd_um=100.0).signature(back)[20, 40], bias, rtol=1e-6)


def test_without_brightness_there_is_no_brightness_edge(view_of):
    view = view_of("plate", y_mm=FINE)
    law = geometric_law(view, None)
    assert ReflectanceEdge(line_sd_um=100.0).apply(law, view) is law


@pytest.mark.parametrize("name", ["finite_spot", "edge_mixing"])
def test_a_line_wider_than_listed_is_so_for_all(name):
    listed = (
        CameraOcclusion(line_sd_um=40.0), FiniteSpot(line_sd_um=60.0), EdgeMixing(line_sd_um=40.0),
        MotionBlur(exposure_ms=1.0),
    )  # fmt: skip
    found = {e.name: e for e in listed if e.name == name}
    wider = {name: found[name].with_parameters(line_sd_um=2 * found[name].line_sd_um)}
    widths = [getattr(e, "line_sd_um", None) for e in as_wide(listed, wider)]
    own = [e.name == name for e in listed]
    # the found one stands in for itself elsewhere
    expected = [w if o else 2 * w for w, o in zip((40.0, 60.0, 40.0), own, strict=False)]
    assert widths == [*expected, None]
    assert as_wide(listed, {}) == list(listed)


SPOT = {"name": "finite_spot", "line_sd_um": 160.0}


CUT_LINE = {"name": "edge_mixing", "line_sd_um": 100.0, "merge_um": 500.0, "weakest": 0.05}


def test_a_line_wider_by_now_leaves_what_was_measured_as_it_is():
    listed = (CameraOcclusion(line_sd_um=40.0), FiniteSpot(line_sd_um=60.0),
              EdgeMixing(line_sd_um=40.0))  # fmt: skip
    shadow, spot, mixing = as_wide(listed, {"finite_spot": listed[1].with_parameters(beam_um=100)})
    assert shadow.line_sd_um == 100.0
    assert (spot, mixing) == listed[1:]
    # one that a file lists is what the next is held against
    wide = (shadow, listed[1].with_parameters(beam_um=100.0), mixing)
    again = as_wide(wide, {"finite_spot": listed[1].with_parameters(beam_um=150.0)})
    assert again[0].line_sd_um == 150.0


@pytest.mark.parametrize("side", ["+y", "-y"])
def test_a_wider_line_on_a_crease_leans_by_lambert_s_law(view_of, side):
    """Half of it on the flat, half on a wall of slope 1, each as bright as the camera sees it."""
    y = np.linspace(17.0, 23.0, 121)
    view = view_of("groove", y_mm=y, sheet={"camera_side": side, "effects": (SPOT, CUT_LINE)})
    crease = int(np.argmin(np.abs(y - 20.0)))
    now = FiniteSpot(line_sd_um=160.0, beam_um=300.0)
    change = (now.shift(view) - FiniteSpot(line_sd_um=160.0).shift(view))[:, 40]
    flat, wall = lambertian_light(view)[[-1, crease - 20], 40]
    cot = COT if side == "+y" else -COT
    expected = (flat * cot + wall * (1 - cot)) / (flat + wall)
    assert np.isclose(change[crease], expected * math.sqrt(2 / math.pi) * 0.2, rtol=0.1)
    # a line is brighter where the camera looks at it less obliquely: s² over the distance
    assert np.all(np.abs(change[np.abs(y - 20.0) > 1.25]) < 2e-3)


def test_a_line_as_wide_as_told_changes_nothing(view_of):
    view = view_of("groove", y_mm=np.linspace(17, 23, 61), sheet={"effects": (SPOT, CUT_LINE)})
    told = FiniteSpot(line_sd_um=160.0)
    assert np.allclose(told.with_parameters(beam_um=100.0).shift(view), told.shift(view))
    assert not np.allclose(told.with_parameters(beam_um=200.0).shift(view), told.shift(view))


def test_a_wider_line_cut_at_an_edge_reads_from_its_own_half(view_of):
    """Where the block hides the line's other half: 0.80 cot θ times what it is wider."""
    y = -10.0 - 10.0 * math.tan(math.radians(30.0)) + np.array([-3.0, 0.0, 3.0])
    view = view_of("step", solid={"height": 10.0}, y_mm=y, sheet={"effects": (SPOT, CUT_LINE)})
    wider = FiniteSpot(line_sd_um=160.0, beam_um=200.0).shift(view)[:, 40]
    told = FiniteSpot(line_sd_um=160.0).shift(view)[:, 40]
    expected = -0.1 * math.sqrt(2 / math.pi) * COT
    assert np.isclose((wider - told)[1], expected, rtol=0.15)
    assert abs((wider - told)[0]) < 1e-9


def test_a_fit_varies_the_current_width_where_a_file_states_the_former_one(view_of):
    listed = view_of("step", sheet={"effects": (SPOT, CUT_LINE)})
    points = FiniteSpot(line_sd_um=160.0).grid(listed)
    assert [p.beam_um for p in points] == [50.0, 140.0, 200.0, 280.0]
    assert [p.name for p in points[0].searched()] == ["beam_um"]
    assert points[0].variants(listed) == ()
    assert "as a laser line of 50 µm" in points[0].describe()
    for unlisted in (view_of("step"), view_of("step", sheet={"effects": (CUT_LINE,)})):
        bare = FiniteSpot(line_sd_um=160.0).grid(unlisted)
        assert all(p.beam_um == 0.0 for p in bare)
    assert [p.name for p in bare[0].searched()] == ["line_sd_um", "lean"]


@pytest.mark.parametrize(("side", "sign"), [("+y", 1.0), ("-y", -1.0)])
def test_half_a_line_on_a_dark_wall_is_read_by_its_other_half(view_of, side, sign):
    """At the rim the flat half alone shines: ± 0.80 s cot θ, without the wall's mean depth."""
    s = 0.3
    y = np.concatenate([20.0 + np.array([0.0, -0.3, -1.2]), [22.0]])
    view = view_of("groove", sheet={"camera_side": side}, y_mm=y)
    # the flat lies 15° off the mirror's angle, the walls 30° and 60°
    bright = math.exp(-((math.tan(math.radians(15)) / math.tan(math.radians(10))) ** 2))
    effect = SpecularDropout(
        share=1.0, lobe_deg=10.0, matt=0.0, threshold=0.05 * bright, softness=0.05
    )
    plain = geometric_law(view, None)
    law = effect.apply(plain, view)
    change = (law.mean_mm - plain.mean_mm)[:, 40]
    half, whole = s * math.sqrt(2 / math.pi), 0.5 * s * math.sqrt(2 / math.pi)
    assert np.isclose(change[0], sign * half * COT - whole, rtol=0.08)
    assert abs(change[3]) < 1e-9
    # with a sixth of the line on the flat there is a reading yet, four deviations off there is none
    assert np.all(law.p_missing[[0, 1, 3], 40] < 0.01)
    assert law.p_missing[2, 40] > 0.99


def test_a_footprint_along_the_line_is_read_by_what_shines_in_it(view_of):
    """On the rim of a groove that runs along the travel: the flat half alone, no camera term."""
    along = 0.3
    spot = {"name": "finite_spot", "line_sd_um": 10.0, "along_um": 1e3 * along}
    effect = SpecularDropout(share=1.0, lobe_deg=10.0, matt=0.0, threshold=0.002, softness=0.05)
    turn = np.array([[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], dtype=float)
    sheet = {"line_width_um": 40.0, "points_per_profile": 601}
    changes, missing = [], []
    for effects in ((spot,), ()):
        lying = view_of("groove", sheet=sheet | {"effects": effects}, y_mm=[0.0, 0.1, 0.2])
        view = lying.posed(turn @ lying.poses)
        plain = geometric_law(view, None)
        law = effect.apply(plain, view)
        changes.append((law.mean_mm - plain.mean_mm)[1])
        missing.append(law.p_missing[1])
    out = np.abs(view.part_mm[1, :, 1]) - 20.0
    rim, beyond = (int(np.argmin(np.abs(out - way))) for way in (0.0, -1.3 * along))
    assert np.isclose(changes[0][rim], -0.5 * along * math.sqrt(2 / math.pi), rtol=0.12)
    # a tenth of the footprint still shines there, of the narrow line nothing
    assert missing[0][beyond] < 0.01 < 0.99 < missing[1][beyond]


def test_a_crease_leans_to_its_brighter_side_where_the_line_is_whole(view_of):
    """At the rim, half the line on a wall of half the brightness and a slope of 1."""
    y = np.linspace(17.0, 23.0, 121)
    bright = np.where(y >= 20.0, 1.0, 0.5)[:, None] * np.ones((1, 81))
    view = view_of("groove", y_mm=y, intensity=bright)
    plain = geometric_law(view, None)
    still, leaning = (FiniteSpot(line_sd_um=300.0, lean=lean) for lean in (0.0, 0.5))
    change = (leaning.apply(plain, view).mean_mm - still.apply(plain, view).mean_mm)[:, 40]
    crease = int(np.argmin(np.abs(y - 20.0)))
    # flat: cot θ; wall: 1 - cot θ, half as bright; without brightness they have 1/2 for a mean
    expected = 0.5 * 0.3 * math.sqrt(2 / math.pi) * ((COT + 0.5 * (1 - COT)) / 1.5 - 0.5)
    assert np.isclose(change[crease], expected, rtol=0.15)
    assert np.all(np.abs(change[np.abs(y - 20.0) > 1.2]) < 1e-9)


def test_a_print_on_a_face_is_no_matter_of_the_line_s_width(view_of):
    """A spot leans at creases; what is printed is `reflectance_edge`'s."""
    y = np.arange(-20, 21) * 0.05
    intensity = np.where(y < 0, 0.8, 0.2)[:, None] * np.ones((1, 80))
    view = view_of("plate", y_mm=y, intensity=intensity)
    assert np.abs(ReflectanceEdge(line_sd_um=100.0).signature(view)).max() > 0.01
    assert np.allclose(FiniteSpot(line_sd_um=100.0, lean=1.0).shift(view), 0.0, atol=1e-9)


def test_a_lean_needs_a_known_brightness(view_of):
    view = view_of("groove")
    leaning, still = FiniteSpot(line_sd_um=300.0, lean=0.5), FiniteSpot(line_sd_um=300.0)
    assert np.array_equal(leaning.shift(view), still.shift(view), equal_nan=True)
    assert leaning.variants(view) == ()


def test_a_line_on_two_walls_has_the_mean_of_both(view_of):
    """Past the groove's bottom at y the share of the line on the far wall is Φ(y / s)."""
    y = np.linspace(-1.5, 1.5, 61)
    view, sd = view_of("groove", y_mm=y), 0.3
    slope = view.slope_y[:, 40]
    mean = line_mean(view, sd, lambda sub: sub.slope_y)[:, 40]
    share = np.array([0.5 * (1 + math.erf(v / sd / math.sqrt(2))) for v in y])
    # a sub-line is half a deviation wide, and holds a fifth of the light
    assert np.allclose(mean, slope[0] + (slope[-1] - slope[0]) * share, atol=0.2)
    assert np.allclose(mean[abs(y) > 3 * sd], slope[abs(y) > 3 * sd])
