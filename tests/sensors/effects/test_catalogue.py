"""One contract for every effect of the catalogue."""

import dataclasses
import inspect
import pickle

import numpy as np
import pytest

from files.errors import RecipeError
from files.record import parse
from files.yaml_document import dump_yaml, load_yaml
from sensors.datasheet import Datasheet
from sensors.effects import (
    CATALOGUE,
    AdditiveEffect,
    DeliveryEffect,
    MotionEffect,
    effect_of,
    effects_of,
)
from sensors.effects.relaxed import MOMENTS, Relaxed
from sensors.law import geometric_law
from sensors.model import SensorModel
from sensors.noise.perlin import PerlinField
from sensors.surface.reflectance import ReflectanceMap, Stripes
from sensors.view.covariates import COVARIATES

NAMES = [
    "camera_occlusion",
    "finite_spot",
    "edge_mixing",
    "reflectance_edge",
    "incidence_noise",
    "incidence_bias",
    "specular_dropout",
    "interreflection",
    "volume_scattering",
    "pixel_locking",
    "column_offset",
    "lens_distortion",
    "line_bow",
    "range_scale",
    "pose_error",
    "stage_vibration",
    "travel_ripple",
    "motion_blur",
    "thermal_drift",
    "outlier_spikes",
    "random_dropout",
    "anisotropic_lay",
    "roughness_level",
    "form_error",
    "light_falloff",
    "lateral_error",
    "axis_quantisation",
    "onboard_filter",
    "row_repeat",
]
MEASURED = {
    "pose_error", "anisotropic_lay", "roughness_level", "axis_quantisation", "onboard_filter",
    "row_repeat", "empirical",
}  # fmt: skip
"""Effects that `diagnosis/claims/` measures by itself; a fitted curve is `empirical`."""
SURFACE = PerlinField(amplitude_mm=0.02, cell_x_mm=2.0, cell_y_mm=2.0)
EVERY = pytest.mark.parametrize("cls", CATALOGUE.values(), ids=CATALOGUE)
STRIPES = ReflectanceMap(base=0.8, stripes=(Stripes(value=0.2, period_mm=7.0),))


@pytest.fixture
def view(view_of):
    """Return a scan in which each effect has something to act on."""
    return view_of("bench", reflectance=STRIPES, y_mm=np.linspace(-24.7, 24.6, 60))


def test_all_names_of_the_contract_are_there():
    assert sorted(CATALOGUE) == sorted([*NAMES, "empirical"]), "enter a new effect in NAMES"
    assert all(cls.name == name for name, cls in CATALOGUE.items())


@EVERY
def test_it_says_what_it_is(cls):
    for text in (cls.summary, cls.equation, cls.source, cls.separating, cls.statement):
        assert len(text) >= 10
    assert cls.channels
    assert set(cls.rivals) <= set(CATALOGUE)
    assert cls.name not in cls.rivals
    assert cls.covariate in COVARIATES
    assert not inspect.isabstract(cls)
    assert "{" not in cls.example().describe()


@EVERY
def test_a_diagnosis_can_recognise_it(cls):
    assert cls.relaxed or cls.name in MEASURED, "without a relaxed form no diagnosis names it"
    names = {p.name for p in cls.parameters()}
    for form in cls.relaxed:
        assert MOMENTS[form.channel] in cls.channels, "channels names what the effect is found by"
        assert {form.frequency, form.period} - {""} <= names, "frequency and period: parameters"


@pytest.mark.parametrize(
    ("form", "message"),
    [
        ({"along": ("dept",)}, "no covariate 'dept'"),
        ({"times": "slope"}, "no covariate 'slope'"),
        ({"along": ("edge_y",), "spanned": True}, "spanned excludes along"),
        ({"along": ("x",), "periodic": True, "frequency": "f_hz"}, "periodic is for the mean"),
        ({"each": "profile", "periodic": True}, "periodic needs the parameter"),
        ({"even": True}, "even needs along"),
        ({"channel": "scale", "along": ("x",), "times": "depth"}, "times is for the mean"),
    ],
)
def test_a_form_that_no_diagnosis_can_build_is_refused(form, message):
    with pytest.raises(ValueError, match=message):
        Relaxed(**{"channel": "mean", **form})


@EVERY
def test_parameters_are_within_bounds_and_frozen(cls):
    effect = cls.example()
    for p in cls.parameters():
        assert p.meaning
        assert p.low < p.high or p.choices
        if p.unit:
            suffix = {"°": "_deg", "µm": "_um", "mm": "_mm", "s": "_s", "Hz": "_hz", "ms": "_ms"}
            assert p.name.endswith(suffix.get(p.unit, f"_{p.unit}"))
        assert (p.prior is not None) == (p.owner == "recording")
        for value in p.grid:
            cls.example().with_parameters({p.name: value})
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(effect, cls.parameters()[0].name, 1.0)


@EVERY
def test_values_out_of_bounds_are_refused_by_name(cls):
    for p in cls.parameters():
        for bad in ("nonsense", [1.0, "x"], float("nan"), True, 2 * abs(p.high) + 1):
            with pytest.raises(RecipeError, match=p.name):
                cls.from_mapping({"name": cls.name, p.name: bad})
    with pytest.raises(RecipeError, match="no parameter 'colour'"):
        effect_of({"name": cls.name, "colour": 1.0})


@EVERY
def test_round_trip_through_a_sensor_file(cls, view, tmp_path):
    for effect in (cls.example(), cls(), cls.none()):
        assert cls.from_mapping(effect.to_mapping()) == effect
        assert pickle.loads(pickle.dumps(effect)) == effect
        sheet = dataclasses.replace(view.datasheet, effects=(effect.to_mapping(),))
        path = tmp_path / "sensor.yaml"
        sheet.save(path)
        assert effects_of(parse(Datasheet, load_yaml(path))) == (effect,)
    assert dump_yaml(cls.example().to_mapping())


@EVERY
def test_zero_strength_is_bit_equal_to_none(cls, view, rng_of):
    none = cls.none()
    assert none.is_null
    law = geometric_law(view, SURFACE)
    assert none.apply(law, view) is law
    sheet = dataclasses.replace(view.datasheet, effects=(none.to_mapping(),))
    listed = type(view)(view.scene, SensorModel(sheet), view.poses, view.time_s, laser=view.laser)
    depth, reason = law.sample(rng_of, view)
    other, other_reason = listed.sensor.law(listed, SURFACE, rng_of).sample(rng_of, listed)
    assert depth.tobytes() == other.tobytes()
    assert reason.tobytes() == other_reason.tobytes()


@EVERY
def test_it_changes_the_channels_that_it_claims(cls, view, view_of):
    if cls.covariate == "slope_x":  # the bench is the same all along the line
        view = view_of("plate", solid={"tilt_x_deg": 20.0})
    law = geometric_law(view, SURFACE)
    new = cls.example().apply(law, view)
    assert not cls.example().is_null
    changed = set()
    both = np.isfinite(law.mean_mm) & np.isfinite(new.mean_mm)
    if np.any(np.broadcast_to(new.mean_mm, view.shape)[both] != law.mean_mm[both]):
        changed.add("mean")
    if np.any(np.isnan(new.mean_mm) != np.isnan(law.mean_mm)) or np.any(new.p_missing):
        changed.add("missing")
    if np.any(new.sd_mm(view) != law.sd_mm(view)):
        changed.add("variance")
    if np.any(new.p_outlier):
        changed.add("tails")
    if new.step_mm != law.step_mm:
        changed.add("variance")
    if new.lay_ratio != law.lay_ratio:
        changed.add("correlation")
    assert changed
    claimed = {*cls.channels, *cls.secondary_channels}
    assert changed <= claimed | ({"missing"} if issubclass(cls, MotionEffect) else set())
    assert new.mean_mm.shape == view.shape
    assert np.array_equal(np.isnan(new.mean_mm), new.reason > 0)


@EVERY
def test_law_is_left_as_it_was(cls, view):
    law = geometric_law(view, SURFACE)
    before = law.mean_mm.copy()
    cls.example().apply(law, view)
    assert np.array_equal(before, law.mean_mm, equal_nan=True)


@EVERY
def test_missing_keys_of_the_datasheet_are_named(cls, view):
    bare = dataclasses.replace(
        view.datasheet,
        triangulation_angle_deg=None,
        line_width_um=None,
        exposure_s=None,
        camera_rows=None,
    )
    blind = type(view)(view.scene, SensorModel(bare), view.poses, view.time_s, reflectance=STRIPES)
    needed = [*cls.needs, *(p.sheet for p in cls.parameters() if p.sheet and p.kind == "number")]
    if needed:
        with pytest.raises(RecipeError, match="|".join(needed)):
            cls().apply(geometric_law(blind, None), blind)
    else:
        cls.example().apply(geometric_law(blind, None), blind)


@EVERY
def test_recording_parameters_are_drawn_from_their_prior(cls):
    own = [p for p in cls.parameters() if p.owner == "recording"]
    opened = cls.example().shared()
    assert set(opened.undrawn()) == {p.name for p in own}
    drawn = [opened.draw(np.random.default_rng(seed)) for seed in range(200)]
    assert drawn[3] == opened.draw(np.random.default_rng(3))
    for p in own:
        values = np.array([getattr(effect, p.name) for effect in drawn])
        low, high = p.prior
        assert low <= values.min() < low + 0.1 * (high - low)
        assert high >= values.max() > high - 0.1 * (high - low)
    if not own:
        assert drawn[0] == opened


@EVERY
def test_mean_is_the_sum_of_the_basis(cls, view):
    effect = cls.example()
    basis = effect.basis(view)
    if basis is None:
        assert not issubclass(cls, AdditiveEffect | MotionEffect)
        return
    coefficients = effect.coefficients()
    assert len(basis.names) == len(basis.fields) == len(coefficients)
    assert np.allclose(effect.with_coefficients(coefficients).coefficients(), coefficients)
    mean = sum(c * f for c, f in zip(coefficients, basis.fields, strict=True))
    if issubclass(cls, AdditiveEffect):
        change = effect.signature(view)
        seen = view.in_range
        assert np.allclose(np.broadcast_to(mean, view.shape)[seen], change[seen], atol=1e-12)


@EVERY
def test_grid_holds_effects_of_its_kind(cls, view):
    grid = cls.example().grid(view)
    assert 1 <= len(grid) <= 600
    assert len(set(grid)) == len(grid)
    assert all(type(effect) is cls for effect in grid)
    starts = cls.example().starts(view)
    assert starts
    assert len(set(starts)) == len(starts)
    assert all(type(effect) is cls for effect in starts)


def test_a_fit_of_many_numbers_starts_with_these_numbers(view):
    (columns,) = CATALOGUE["column_offset"]().starts(view)
    assert columns.is_null
    assert len(columns.values_um) == 64
    waves = CATALOGUE["form_error"].example().starts(view)
    assert [len(form.coefficients_um) for form in waves] == [5, 14, 27, 44]
    assert all(form.is_null for form in waves)


def test_one_effect_follows_the_albedo():
    assert [cls.name for cls in CATALOGUE.values() if cls.on_albedo] == ["reflectance_edge"]


def test_unknown_effect_is_named_with_what_there_is(view):
    sheet = dataclasses.replace(view.datasheet, effects=({"name": "ghost"},))
    with pytest.raises(RecipeError, match=r"sensor 'test': effects\[0\].*ghost.*camera_occlusion"):
        effects_of(sheet)


@EVERY
def test_turning_sensor_and_part_together_changes_nothing(cls, view_of):
    """The bench looks the same from the other side, so the turned sensor reads the same."""
    y = np.linspace(-24.7, 24.6, 60)
    stripes = Stripes(value=0.2, period_mm=14.0, start_mm=-3.5)
    bright = ReflectanceMap(base=0.8, stripes=(stripes,))
    effect = cls.example()
    if cls.name == "form_error":  # only even waves look the same from the other side
        effect = effect.with_parameters(coefficients_um=(0.0, 0.0, 40.0, 20.0, -40.0))
    one = view_of("bench", reflectance=bright, y_mm=y)
    other = view_of("bench", reflectance=bright, y_mm=-y, turned=True)
    law, turned = (effect.apply(geometric_law(v, SURFACE), v) for v in (one, other))
    assert np.allclose(law.mean_mm, turned.mean_mm, atol=1e-9, equal_nan=True)
    assert np.allclose(law.p_missing, turned.p_missing, atol=1e-9)
    assert np.allclose(law.sd_mm(one), turned.sd_mm(other), atol=1e-9)


@EVERY
@pytest.mark.parametrize("columns", ["even_x", "even_angle"])
@pytest.mark.parametrize("height_mm", [200.0, 290.0])
def test_missing_points_stay_missing(cls, view_of, rng_of, columns, height_mm):
    """Scans with gaps, or with nothing in range at all, raise no warning and gain no points."""
    view = view_of(
        "end",
        sheet={"columns": columns},
        height_mm=height_mm,
        reflectance=STRIPES,
        y_mm=np.linspace(-15.0, 15.0, 24),
    )
    law = cls.example().apply(geometric_law(view, SURFACE), view)
    depth, reason = law.sample(rng_of, view)
    assert np.array_equal(np.isnan(depth), reason > 0)
    if not issubclass(cls, MotionEffect | DeliveryEffect):  # firmware may fill or repeat
        assert np.isnan(depth[~view.in_range]).all()
    if cls.channels == ("mean",):
        assert np.isfinite(law.mean_mm[view.in_range]).all()
    cls.example().grid(view)
    cls.example().covariate_values(view)


@EVERY
def test_what_acts_on_a_file_that_states_little_has_its_covariate_there(cls, view_of):
    """What a diagnosis can find can be drawn: a camera's angle that was fitted is no file's."""
    optional = {f.name: None for f in dataclasses.fields(Datasheet) if f.default is None}
    view = view_of("step", sheet=optional, reflectance=STRIPES)
    law = geometric_law(view, SURFACE)
    if cls.needs:  # it can't be found there
        with pytest.raises(RecipeError, match=cls.needs[0]):
            cls.example().apply(law, view)
        return
    cls.example().apply(law, view)
    assert np.isfinite(np.broadcast_to(cls.example().covariate_values(view), view.shape)).any()


@EVERY
def test_bounds_are_workable(cls, view):
    """Each parameter at either bound gives a law whose numbers are numbers."""
    law = geometric_law(view, SURFACE)
    example = cls.example()
    if cls.name == "empirical":  # a value that is a probability as well
        example = example.with_parameters(values=(0.0, 0.5))
    for p in cls.parameters():
        if p.kind not in ("number", "choice"):
            continue
        for value in p.choices or (p.low, p.high):
            new = example.with_parameters({p.name: value}).apply(law, view)
            assert np.array_equal(np.isnan(new.mean_mm), new.reason > 0)
            sd = new.sd_mm(view)[new.reason == 0]
            assert np.all(np.isfinite(sd) & (sd > 0))
            for share in (new.p_missing, new.p_outlier):
                known = np.broadcast_to(share, view.shape)[new.reason == 0]
                assert np.all((known >= 0) & (known <= 1))
