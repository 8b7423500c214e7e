"""Laws compete as they are fitted: which is named, and which are offered beside it."""

import pytest

from diagnosis.components.component import components_of
from diagnosis.evidence.reported_causes import Cause
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.physics.joint_fit import among_laws, fit_law, strongest_law
from sensors.effects.finite_spot import FiniteSpot
from sensors.effects.line_bow import LineBow
from sensors.effects.motion_blur import MotionBlur
from tests.support.effect_case import bench_workspace, taken_with

AT_EDGES = [c for c in components_of("mean") if c.effect in ("finite_spot", "edge_mixing")]


def named(name: str) -> Cause:
    return Cause(
        name=name, channel="mean", probability=0.9, alternatives=(), none_of_these=0.1, nats=50.0
    )


@pytest.fixture(scope="module")
def blurred() -> Workspace:
    return taken_with(bench_workspace("steps"), "steps", FiniteSpot(line_sd_um=150.0))


def test_the_law_that_fits_is_named_whatever_span_was_weighed(blurred: Workspace) -> None:
    cause, gain, _ = among_laws(named("finite_spot"), AT_EDGES, blurred, Model())
    assert cause.name == "finite_spot"
    assert gain > 50.0
    assert cause.nats == pytest.approx(gain)
    offered = [p for _, p in cause.alternatives]
    assert cause.probability + sum(offered) == pytest.approx(0.9, abs=0.05)


def test_no_law_stands_in_for_one_that_does_nothing() -> None:
    still = bench_workspace("domes")
    cause, gain, _ = among_laws(named("interreflection"), AT_EDGES, still, Model())
    assert (cause.name, gain) == ("interreflection", 0.0)


def test_the_strongest_law_comes_first() -> None:
    bent = taken_with(bench_workspace("domes"), "domes", LineBow(sag_um=40.0))
    first = strongest_law([named("incidence_bias"), named("line_bow")], bent, Model())
    assert first.name == "line_bow"


def test_a_blur_in_steady_light_is_seen_before_its_law_is_searched() -> None:
    """Which laws are fitted at all is decided at points of their grids."""
    steady = MotionBlur(exposure_ms=20.0, flicker=0.0, stamped="middle")
    moved = taken_with(bench_workspace("steps"), "steps", steady)
    rough, fitted = (
        fit_law(named("motion_blur"), moved, Model(), polish=polish) for polish in (False, True)
    )
    assert rough is not None
    assert fitted is not None
    assert rough.gain > 0.9 * fitted.gain > 1000.0
