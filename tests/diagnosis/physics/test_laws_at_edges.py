"""Laws of light at edges, weighed by what they do themselves."""

import math
from dataclasses import replace

import numpy as np
import pytest

from diagnosis.components.component import components_of
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.physics.effect_fit import fit_effect
from diagnosis.physics.laws_at_edges import (
    LawAtEdges,
    key_of,
    known_laws,
    laws_in_turn,
    may_be_named,
    nats_of_law,
    unusual_at_edges,
)
from diagnosis.settings import SETTINGS
from sensors.effects.finite_spot import FiniteSpot
from sensors.effects.form_error import FormError
from sensors.effects.interreflection import Interreflection
from sensors.effects.line_bow import LineBow
from sensors.effects.motion_blur import MotionBlur
from tests.support.effect_case import bench_workspace, taken_with
from tests.support.small_parts import datasheet

LAWS = [c for c in components_of("mean") if c.effect in ("finite_spot", "motion_blur")]
SIZES = SETTINGS.mean_sizes()
BLUR = FiniteSpot(line_sd_um=300.0)


@pytest.fixture(scope="module")
def sharp() -> Workspace:
    return bench_workspace("steps")


@pytest.fixture(scope="module")
def blurred() -> Workspace:
    return taken_with(bench_workspace("steps"), "steps", BLUR)


def usual(size: float) -> dict[str, np.ndarray]:
    """Good instruments have that much of each law."""
    weights = np.exp(-0.5 * np.square(np.log(SIZES / size)))
    return {key_of(law, listed=""): weights / weights.sum() for law in LAWS}


def each_alone(ws: Workspace, before: Workspace | None = None) -> dict[str, LawAtEdges]:
    return {law.effect: laws_in_turn([law], ws, Model(), before)[0] for law in LAWS}


def test_a_law_explains_what_it_made(blurred: Workspace, sharp: Workspace) -> None:
    found, still = each_alone(blurred), each_alone(sharp)
    spot = found["finite_spot"]
    assert spot.size == pytest.approx(np.sqrt(2 * spot.gain / blurred.count()))
    assert spot.size > 5 * still["finite_spot"].size
    # the likeliest deviation of one number is that number
    assert SIZES[spot.factors.argmax()] == pytest.approx(spot.size, rel=0.5)


def test_a_reflection_is_found_where_its_corner_is_an_edge() -> None:
    """All that it changes is beside the corner's edge, where nothing was fitted."""
    true = Interreflection(weight=0.02, reach_mm=0.8, power=2.0)
    lit = taken_with(bench_workspace("valley"), "valley", true)
    for patch in lit.patches:
        change = np.nan_to_num(true.fields(patch.view)[0])
        assert np.square(change[patch.edge]).sum() > 0.99 * np.square(change).sum()
    (law,) = (c for c in components_of("mean") if c.effect == true.name)
    (found,) = laws_in_turn([law], lit, Model())
    assert found.gain > 100
    assert found.fitted is not None
    assert found.fitted.effect.weight == pytest.approx(true.weight, rel=0.5)


def test_at_edges_a_part_s_form_is_its_corners(sharp: Workspace) -> None:
    """Waves of a part are no law of light at edges: they took the name from one."""
    waves = FormError(coefficients_um=(0.0, 0.0, 40.0, 20.0, -40.0))
    bent = taken_with(sharp, "steps", waves)
    states = bent.states(bent.predict(Model()))
    everywhere = fit_effect(FormError, bent, Model(), states, polish=False)
    corners = fit_effect(FormError, bent, Model(), states, polish=False, at_edges=True)
    assert isinstance(everywhere.effect, FormError)
    assert everywhere.effect.bent_um() > 10
    assert corners is None or corners.effect.coefficients_um == ()


def test_it_is_named_where_good_instruments_have_less(blurred: Workspace) -> None:
    alone = each_alone(blurred)
    found = list(alone.values())
    (first, *_), _ = unusual_at_edges(found, usual(0.002))
    assert first.name == "finite_spot"
    assert first.probability > 0.8
    causes, habits = unusual_at_edges(found, usual(alone["finite_spot"].size))
    assert "finite_spot" not in [c.name for c in causes]
    (habit,) = [h for h in habits if h.component == "finite_spot"]
    assert habit.nats == pytest.approx(alone["finite_spot"].gain)
    assert habit.probability < 0.5
    assert unusual_at_edges([], {}) == ([], [])


def test_what_a_law_loses_on_further_readings_makes_it_smaller(
    blurred: Workspace, sharp: Workspace
) -> None:
    (law,) = (one for one in LAWS if one.effect == "finite_spot")
    further = [replace(p, recording=p.recording + k) for k in (10, 20) for p in sharp.patches]
    both = Workspace.build([*blurred.patches, *further], blurred.noise)

    def nats(ws: Workspace, size: float) -> float | None:
        return nats_of_law(law, BLUR, ws, Model(), None, usual(size), explained=0.0)

    kept, lost = nats(blurred, 0.002), nats(both, 0.002)
    assert kept > 3
    assert lost < 0
    assert nats_of_law(law, BLUR, blurred, Model(), None, {}, explained=0.0) is None
    # baselines that are blurred alike: nothing has changed
    effect = laws_in_turn([law], blurred, Model())[0].fitted.effect
    assert nats_of_law(law, effect, blurred, Model(), blurred, usual(0.002), explained=0.0) < 0


def test_a_law_that_gains_nothing_beside_other_causes_is_none(sharp: Workspace) -> None:
    """Whatever it was found by: even where no size could tell it from good instruments'."""
    (law,) = (c for c in LAWS if c.effect == "motion_blur")
    blur = MotionBlur(exposure_ms=1e-4)
    beside = Model().with_effect(LineBow(sag_um=1.0))
    for known in (usual(0.01), {}):
        assert nats_of_law(law, blur, sharp, beside, None, known, explained=0.0) == -math.inf
    # alone it is judged by the readings held out
    assert nats_of_law(law, blur, sharp, Model(), None, {}, explained=0.0) is None


def test_a_law_that_resembles_the_strongest_explains_little_beside_it(blurred: Workspace) -> None:
    alone = each_alone(blurred)
    first, other = laws_in_turn(LAWS, blurred, Model())
    assert first.component.effect == "finite_spot"
    assert first.size == pytest.approx(alone["finite_spot"].size)
    assert other.component.effect == "motion_blur"
    assert alone["motion_blur"].size > 0.03
    assert other.size < 0.3 * alone["motion_blur"].size


def test_what_both_laws_do_in_baselines_is_no_change_either(blurred: Workspace) -> None:
    both = laws_in_turn(LAWS, blurred, Model(), before=blurred)
    assert max(law.gain for law in both) > 50
    assert [law.size for law in both] == pytest.approx([0.0, 0.0], abs=0.02)


def test_what_baselines_have_as_well_is_no_change(blurred: Workspace) -> None:
    spot = each_alone(blurred, before=blurred)["finite_spot"]
    assert spot.gain > 50
    assert spot.size == pytest.approx(0.0, abs=1e-6)


def test_a_change_is_what_the_law_of_the_baselines_leaves() -> None:
    longer, long = (
        taken_with(bench_workspace("steps"), "steps", MotionBlur(exposure_ms=exposure))
        for exposure in (7.0, 6.0)
    )
    alone = each_alone(longer)["motion_blur"].size
    assert alone > 0.1
    assert each_alone(longer, before=long)["motion_blur"].size < 0.4 * alone


def test_baselines_with_less_noise_show_no_law(sharp: Workspace) -> None:
    moved = taken_with(bench_workspace("steps"), "steps", MotionBlur(exposure_ms=7.0))
    quiet = Workspace.build(sharp.patches, replace(sharp.noise, sd_mm=2 * sharp.noise.sd_mm))
    alone, beside = (each_alone(moved, before)["motion_blur"].size for before in (None, quiet))
    assert alone > 0.1
    assert beside > 0.9 * alone


def test_a_law_needs_what_its_formula_needs() -> None:
    names = {c.effect for c in known_laws(components_of("mean"), datasheet())}
    assert {"finite_spot", "motion_blur", "form_error"} <= names
    assert "line_bow" not in names


def test_no_law_is_tried_that_no_reading_could_name() -> None:
    law = LAWS[0]
    known = key_of(law, listed="")
    anything = np.full(SIZES.size, 1 / SIZES.size)
    assert may_be_named(law, usual(0.002), listed="")
    assert not may_be_named(law, {known: anything}, listed="")
    assert not may_be_named(law, usual(0.002), listed="listed")  # nobody has seen one
