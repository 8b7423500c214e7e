"""Cases: reproducible, balanced, and each formula changes what it is about."""

from dataclasses import replace

import numpy as np
import pytest
import yaml

from benchmarks.other_formulas.cases import (
    POPULATIONS,
    Case,
    nominal_shot,
    plan,
    plan_of_habits,
    stage,
    write,
)
from benchmarks.other_formulas.formulas import (
    BY_NAME,
    CATALOGUED,
    LAWS,
    OUTSIDE,
    UNJUDGED,
)
from benchmarks.other_formulas.formulas.laws import true_parameters
from benchmarks.other_formulas.instrument import OPTIONAL
from sensors.effects import CATALOGUE
from sensors.recording import Recording


def case(formulas, part, **more):
    given = {"name": "t", "kind": "one", "wanted": 0, "baselines": True, "plate": True, "seed": 5}
    return Case(formulas=formulas, part=part, **{**given, **more})


def test_every_effect_of_the_catalogue_has_two_formulas():
    counts = {name: sum(f.effect == name for f in CATALOGUED) for name in CATALOGUE}
    few = {name for name, count in counts.items() if count < 2} - {"empirical"}
    assert few == UNJUDGED, "write two formulas of each, or enter it in UNJUDGED"
    assert sum(counts.values()) == len(CATALOGUED)


def test_eight_kinds_lie_outside():
    assert len(OUTSIDE) >= 8
    assert all(not f.effect for f in OUTSIDE)


def test_populations_share_no_seed_and_plans_no_case():
    seeds = [s for some in POPULATIONS.values() for s in some]
    assert len(seeds) == len(set(seeds))
    assert not {c.seed for c in plan(0)} & {c.seed for c in plan(200)}


def test_the_first_cases_of_a_plan_have_all_kinds_in_proportion():
    whole, part = plan(3), plan(3)[:70]
    for kind in ("null", "one", "outside"):
        full = sum(c.kind == kind for c in whole) / len(whole)
        assert sum(c.kind == kind for c in part) / 70 == pytest.approx(full, abs=0.06)


def test_files_are_recordings_and_the_sheet_leaves_half_of_the_optional_keys_out(tmp_path):
    made = stage(case(("arc",), "hills", wanted=12))
    truth = write(made, tmp_path)
    assert truth["effects"] == ["line_bow"]
    stated = yaml.safe_load((tmp_path / "sensor.yaml").read_text())
    assert len(OPTIONAL) - sum(k in stated for k in OPTIONAL) in (3, 4)
    for name in ("rec-0", "rec-2", "base-1", "plate"):
        read = Recording.load(tmp_path / f"{name}.h5")
        assert np.isfinite(read.depth_mm).mean() > 0.5


def test_the_same_case_is_the_same_bytes(tmp_path):
    for name in ("a", "b"):
        write(stage(case(("stick-slip",), "roof", wanted=6)), tmp_path / name)
    for file in ("rec-1.h5", "base-0.h5", "part.stl", "sensor.yaml"):
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()


@pytest.mark.parametrize("name", sorted(BY_NAME))
def test_a_formula_changes_a_recording_and_a_size_of_almost_nothing_hardly(name):
    formula = BY_NAME[name]
    part = (formula.parts or ("hills",))[0]
    made = stage(case((), part))
    shot = nominal_shot(made, made.scans[0], 0)

    def drawn(size):
        return formula.apply(shot, size, 5).sample(np.random.default_rng(1))

    plain, with_it = shot.sample(np.random.default_rng(1)), drawn(1.0)
    changed = np.nan_to_num(plain) != np.nan_to_num(with_it)
    bright = formula.apply(shot, 1.0, 5).intensity is not None
    assert changed.any()
    assert np.isfinite(with_it).mean() > 0.3
    if formula.scaled and formula.effect != "anisotropic_lay":  # whose kernel is larger
        little = np.abs(np.nan_to_num(drawn(1e-7) - plain))
        assert np.quantile(little, 0.98) <= made.instrument.sheet.step_mm * 1.01
    assert bright == (formula.effect == "reflectance_edge")


@pytest.mark.parametrize("formula", LAWS, ids=lambda f: f.effect)
def test_a_law_states_its_true_parameters_and_reaches_its_strength(formula):
    made = stage(case((formula.name,), "freeform", kind="law", wanted=24))
    assert made.reached == pytest.approx(24, rel=0.1)
    true = true_parameters(formula.name, made.sizes[0], made.case.seed)
    assert set(true) <= {p.name for p in CATALOGUE[formula.effect].parameters()}


def test_a_habit_is_in_the_baselines_and_hides_nothing(tmp_path):
    case = Case(
        name="h", kind="habit", formulas=("quadratic scale",), wanted=0, part="terraces",
        baselines=True, plate=False, seed=3,
    )  # fmt: skip
    truth = write(stage(case), tmp_path / "habit")
    plain = replace(case, kind="one")
    assert truth["effects"] == []
    assert write(stage(plain), tmp_path / "one")["effects"] == ["range_scale"]
    habit, one = (
        [Recording.load(tmp_path / kind / f"{name}-0.h5").depth_mm for name in ("base", "rec")]
        for kind in ("habit", "one")
    )
    assert np.array_equal(habit[1], one[1], equal_nan=True)
    assert not np.array_equal(habit[0], one[0], equal_nan=True)


def test_habits_are_planned_of_every_formula():
    planned = plan_of_habits(7)
    assert {f for c in planned for f in c.formulas} == {f.name for f in (*CATALOGUED, *OUTSIDE)}
    assert all(c.kind == "habit" and c.baselines for c in planned)


def test_grooves_and_ellipses_of_a_lay_lie_fixed_on_the_part():
    """In each scan the noise is longest correlated along the same direction of the part."""
    case = Case(
        name="l", kind="one", formulas=("elliptic lay",), wanted=0, part="hills", baselines=False,
        plate=True, seed=11,
    )  # fmt: skip
    staged = stage(case)
    ways = []
    for k, scan in enumerate(staged.scans):
        shot = BY_NAME["elliptic lay"].apply(nominal_shot(staged, scan, k), 2.0, case.seed)
        lags = shot.noise.autocorrelation
        half = [n // 2 for n in lags.shape]
        v, u = np.mgrid[-half[0] : half[0] + 1, -half[1] : half[1] + 1]
        step_x = np.median(np.abs(np.diff(shot.view.x, axis=1)))
        step_y = np.linalg.norm(np.median(np.diff(scan.poses[:, :3, 3], axis=0), axis=0))
        spread = np.einsum("nm,inm,jnm->ij", lags, *2 * [np.stack([u * step_x, v * step_y])])
        along = np.linalg.eigh(spread)[1][:, -1]
        travel = scan.poses[-1, :3, 3] - scan.poses[0, :3, 3]
        way = along[0] * scan.poses[0, :3, 0] + along[1] * travel / np.linalg.norm(travel)
        ways.append(np.arctan2(way[1], way[0]))
    off = [(w - ways[0] + np.pi / 2) % np.pi - np.pi / 2 for w in ways]
    assert np.abs(off).max() < 0.15
