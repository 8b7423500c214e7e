"""Plans: a box from six sides, a hidden face that no pass sees, a set cover by hand."""

import h5py
import numpy as np
import pandas as pd
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from files.errors import RecipeError
from flawforge.cli import main
from pipeline.batch.run import generate
from pipeline.batch.trial import try_recipe
from pipeline.motion.recorded_path import replay
from pipeline.parts.part import Part
from pipeline.passes.pareto import front, trade
from pipeline.passes.reference_flaw import PIT_MM, ReferencePit, smallest_depth_mm
from pipeline.passes.set_cover import plan_cover
from pipeline.passes.straight_passes import Pass, Samples, candidates
from pipeline.recipe import Recipe
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet
from sensors.surface.surface import Surface

SHEET = Datasheet(
    name="s", working_distance_mm=100.0, z_range_mm=60.0, x_fov_mm=40.0, points_per_profile=81,
    z_resolution_um=1.0, profile_rate_hz=500.0, triangulation_angle_deg=20.0, columns="even_x",
)  # fmt: skip


def sampled(mesh, count):
    part = Part(name="p", vertices_mm=np.array(mesh.vertices), faces=np.array(mesh.faces))
    scene = Scene(part.vertices_mm, part.faces)
    return Samples.of(part, scene, count, np.random.default_rng(1)), scene


def looked_at(mesh, count=1500):
    samples, scene = sampled(mesh, count)
    return samples, list(candidates(samples, scene, SHEET))


def test_samples_are_even_in_area():
    samples, _ = sampled(trimesh.creation.box(extents=(10, 20, 30)), 6000)
    up = np.abs(samples.normals[:, 2]) > 0.9
    assert up.mean() == pytest.approx(200 / 1100, abs=0.005)


def test_a_box_is_seen_whole_and_one_look_down_sees_its_top_alone():
    samples, tried = looked_at(trimesh.creation.box(extents=(30, 30, 30)))
    plan = plan_cover(tried, 1.0)
    assert plan.reachable == plan.coverage[-1] == 1.0
    assert (np.diff(plan.coverage) > 0).all()
    down = [one for one in tried if one.look[2] == -1]
    top = samples.normals[:, 2] > 0.9
    assert all((one.seen == top).all() for one in down)
    assert all(one.cosine[top] == pytest.approx(1) for one in down)


def test_inside_a_closed_hollow_nothing_is_seen():
    box = trimesh.creation.box(extents=(30, 30, 30))
    hollow = trimesh.creation.box(extents=(20, 20, 20))
    hollow.invert()
    samples, tried = looked_at(trimesh.util.concatenate([box, hollow]))
    inner = (np.abs(samples.points_mm) < 10.01).all(axis=1)
    plan = plan_cover(tried, 0.98)
    assert not plan.seen[inner].any()
    assert plan.reachable == pytest.approx((~inner).mean())


def made_up(seen, length):
    seen = np.array(seen, bool)
    ends = np.array([[0.0, 0, 0], [0, length, 0]])
    return Pass(
        look=np.array([0, 0, -1.0]), travel=np.array([0, 1.0, 0]), start_mm=ends[0],
        end_mm=ends[1], seen=seen, cosine=seen * 0.5,
    )  # fmt: skip


def test_cover_takes_what_sees_most_per_length_and_drops_what_is_needless():
    wide = made_up([1, 1, 1, 0], 30)
    left, right = made_up([1, 1, 0, 0], 10), made_up([0, 0, 1, 1], 10)
    plan = plan_cover([wide, left, right], 1.0)
    assert set(plan.passes) == {left, right}
    assert plan.length_mm.tolist() == [10, 20]
    assert plan.coverage.tolist() == [0.5, 1.0]
    assert plan.incidence_deg == pytest.approx([60, 60])
    small = made_up([0, 1, 1, 0], 5)  # first by gain, needless in the end
    assert small not in plan_cover([small, left, right], 1.0).passes
    assert len(plan_cover([wide, left, right], 0.5).passes) == 1


def test_the_command_writes_passes_that_a_recipe_follows(tmp_path, capsys):
    mesh = tmp_path / "box.stl"
    trimesh.creation.box(extents=(30, 30, 30)).export(mesh)
    SHEET.save(tmp_path / "sensor.yaml")
    words = ["plan", str(mesh), "--sensor", str(tmp_path / "sensor.yaml"), "--samples", "500",
             "--profiles", "50", "--out", str(tmp_path / "plan")]  # fmt: skip
    assert main(words) == 0
    assert "100.0%" in capsys.readouterr().out
    first = tmp_path / "plan" / "pass-00.h5"
    with h5py.File(first) as file:
        assert file["pose"].shape == (50, 4, 4)
    assert replay(str(first), 500.0, 50).poses.shape == (50, 4, 4)
    assert (tmp_path / "plan" / "plan.png").stat().st_size > 10_000
    assert main([*words[:-2], "--cover", "2", "--out", str(tmp_path / "x")]) == 2


COVER = ["motion={cover: 0.98}", "specimens=1", "splits={train: 1.0}", "flaws={pit: 1}"]


@pytest.mark.slow
def test_a_recipe_with_cover_takes_pass_after_pass(recipe_path, tmp_path):
    recipe = Recipe.load(recipe_path, sets=[*COVER, "scans=3"])
    dataset = generate(recipe, tmp_path / "out")
    rows = pd.read_parquet(tmp_path / "out" / "manifest.parquet")
    mine = rows[rows["part"] == "a"]
    assert mine["planned_pass"].tolist() == [0, 1, 2]
    planned = int(mine["planned_passes"].iloc[0])
    assert planned > 3
    assert any(f"part a: 3 of {planned} planned passes" in text for text in dataset["warnings"])
    trial = try_recipe(recipe, specimens=1, scans=2)
    assert any(f"part a: 3 of {planned} planned passes" in t for t in trial.dataset["warnings"])
    assert (mine["share_valid"] > 0).all()


def test_cover_and_path_exclude_each_other(recipe_path):
    with pytest.raises(RecipeError, match="either"):
        Recipe.load(recipe_path, sets=["motion={cover: 0.9, path: a.csv}"])


def test_the_front_holds_the_plans_that_no_other_beats():
    points = [(10, [1, 0, 0, 0]), (10, [1, 1, 0, 0]), (20, [1, 1, 0, 0]), (15, [1, 0, 0, 0]),
              (30, [1, 1, 1, 1]), (10, [0, 1, 1, 0])]  # fmt: skip
    plans = [plan_cover([made_up(seen, length)], 1.0) for length, seen in points]
    assert front(plans).tolist() == [False, True, False, False, True, False]


@given(seed=st.integers(0, 10**6))
@settings(max_examples=30, deadline=None)
def test_each_plan_is_on_the_front_or_beaten_by_one_that_is(seed):
    rng = np.random.default_rng(seed)
    tried = [made_up(rng.random(40) < 0.3, rng.uniform(5, 50)) for _ in range(8)]
    plans = trade(tried, 0.95)
    optimal = front(plans)
    ends = [(plan.length_mm[-1], plan.coverage[-1]) for plan in plans]
    best = [end for end, good in zip(ends, optimal, strict=True) if good]
    for length, coverage in ends:
        assert any(a <= length and b >= coverage for a, b in best)
    for a, b in best:
        assert not any((x <= a and y > b) or (x < a and y >= b) for x, y in ends)


@pytest.mark.parametrize("degrees", [0, 30, 60])
def test_a_pit_in_white_noise_has_the_closed_form(degrees):
    angle, px, py, sd = np.radians(degrees), 0.02, 0.03, 0.01
    closed = 5 * sd * np.sqrt(12 * px * py * np.cos(angle) / (np.pi * PIT_MM**2))
    assert smallest_depth_mm(angle, px, py, sd) == pytest.approx(closed, rel=1e-3)


def test_correlation_over_the_whole_pit_leaves_one_reading():
    """With all noise in common a filter gains nothing by more readings."""
    depths = [
        smallest_depth_mm(0.0, pitch, pitch, 0.0, 0.01, np.ones((401, 401)))
        for pitch in (0.02, 0.04)
    ]
    # Σd² / (s Σd) of a paraboloid: mean square 1/3 over mean 1/2
    assert depths == pytest.approx([5 * 0.01 * 1.5] * 2, rel=1e-2)


def test_roughness_and_sparse_profiles_hide_pits():
    _, tried = looked_at(trimesh.creation.box(extents=(30, 30, 30)), 300)
    one = next(one for one in tried if one.look[2] == -1)

    def pit(surface, profiles):
        depths = ReferencePit(datasheet=SHEET, surface=surface, profiles=profiles).depths_mm(one)
        assert np.isinf(depths[~one.seen]).all()
        return depths[one.seen].mean()

    smooth = pit(None, 400)
    assert pit(None, 100) == pytest.approx(2 * smooth, rel=0.05)  # square root of the readings
    assert pit(Surface.load("steel_plate"), 400) > 10 * smooth
