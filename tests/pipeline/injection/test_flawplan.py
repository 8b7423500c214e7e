"""The `flaws:` part of a recipe: what it may say, and one line for what it may not."""

import numpy as np
import pytest

from pipeline.injection.flawplan import FlawPlan
from quantity.distribution import Uniform


def test_reads_kinds_options_and_tiers():
    plan = FlawPlan.from_mapping(
        {
            "dent": {
                "number": {"choice": [1, 2]},
                "depth_mm": {"uniform": [0.1, 0.4]},
                "tiers": {
                    "slight": {"weight": 3, "scale": 0.5},
                    "severe": {"depth_mm": 1.0},
                },
            },
            "crack": 2,
            "min_distance_mm": 4,
            "where": ["top"],
            "keep_free": ["rim", [[0, 0, 0], [1, 1, 1]]],
            "facet_um": 2,
            "tries": 5,
        }
    )
    dent, crack = plan.kinds
    assert dent.sizes["depth_mm"] == Uniform(low=0.1, high=0.4)
    assert [tier.name for tier in dent.tiers] == ["slight", "severe"]
    assert crack.number.draw(np.random.default_rng(0)) == 2
    assert plan.where == ("top",)
    assert plan.keep_free == ("rim",)
    assert plan.keep_free_boxes_mm == (((0, 0, 0), (1, 1, 1)),)
    assert (plan.min_distance_mm, plan.facet_um, plan.tries) == (4.0, 2.0, 5)
    assert FlawPlan.from_mapping({"where": "visible"}).where == ()


def test_tiers_come_by_weight_and_change_the_sizes():
    plan = FlawPlan.from_mapping(
        {
            "dent": {
                "depth_mm": 0.4,
                "length_mm": 10,
                "tiers": {
                    "slight": {"weight": 3, "scale": 0.5},
                    "severe": {"weight": 1, "scale": 2, "depth_mm": 1.0},
                },
            }
        }
    )
    rng = np.random.default_rng(3)
    drawn = [plan.kinds[0].draw(rng) for _ in range(2000)]
    slight = [flaw for tier, flaw in drawn if tier == "slight"]
    severe = [flaw for tier, flaw in drawn if tier == "severe"]
    assert abs(len(slight) - 1500) < 4 * np.sqrt(2000 * 0.75 * 0.25)
    assert {(flaw.depth_mm, flaw.length_mm) for flaw in slight} == {(0.2, 5.0)}
    # A size that the tier sets itself isn't scaled.
    assert {(flaw.depth_mm, flaw.length_mm) for flaw in severe} == {(1.0, 20.0)}


@pytest.mark.parametrize(
    ("data", "says"),
    [
        ({"dint": 1}, r"^dint: unknown key; did you mean 'dent'\?$"),
        ({"zzz": 1}, "^zzz: unknown key; allowed: dent, crack"),
        ({3: 1}, "^3: unknown key; allowed: dent, crack"),
        ({"min_distance": 1}, "did you mean 'min_distance_mm'"),
        ({"dent": {"depht_mm": 1}}, r"^dent.depht_mm: unknown key; did you mean 'depth_mm'\?$"),
        ({"dent": {"zzz": 1}}, "dent.zzz: unknown key; allowed: length_mm, .*, number, tiers$"),
        ({"dent": {"numbr": 1}}, "dent.numbr: unknown key; did you mean 'number'"),
        ({"bank": {"path": "b", "pth": 1}}, "bank.pth: unknown key; did you mean 'path'"),
        ({"dent": {"depth_mm": {"uniform": [0.1, 99]}}}, "dent.depth_mm: .* 0.005 to 20"),
        ({"dent": {"depth_mm": {"gauss": [0.1, 99]}}}, "dent.depth_mm: .* must be a number or"),
        ({"dent": {"number": -1}}, "dent.number: -1 must stay within 0 to 1000"),
        ({"dent": {"number": "few"}}, "dent.number: 'few' must be"),
        ({"dent": [1]}, "dent: .* must be a number or a mapping"),
        ({"dent": {"tiers": {}}}, "dent.tiers: {} must be"),
        ({"dent": {"tiers": {"a": 3}}}, "dent.tiers.a: 3 must be a mapping"),
        ({"dent": {"tiers": {"a": {"weight": 0}}}}, "dent.tiers: at least one weight"),
        ({"dent": {"tiers": {"a": {"scale": "x"}}}}, "dent.tiers.a.scale: 'x' must be"),
        ({"dent": {"tiers": {"a": {"depth": 1}}}}, "a.depth: unknown key; did you mean 'depth_mm'"),
        ({"dent": {"tiers": {"a": {"wieght": 1}}}}, "a.wieght: unknown key; did you mean 'weight'"),
        ({"min_distance_mm": -1}, "min_distance_mm: -1 must be a number from 0"),
        ({"where": 3}, "where: 3 must be 'visible' or a list"),
        ({"keep_free": [[[0, 0, 0], [1, -1, 1]]]}, "keep_free: .* low first"),
        ({"keep_free": 3}, "keep_free: 3 must be a list"),
        ([1], "must be a mapping"),
    ],
)
def test_bad_plans_give_one_line(data, says):
    with pytest.raises(ValueError, match=says) as caught:
        FlawPlan.from_mapping(data)
    assert "\n" not in str(caught.value)
