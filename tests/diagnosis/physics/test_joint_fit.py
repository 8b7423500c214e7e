"""Laws of several effects are refitted beside each other."""


import pytest

from diagnosis.evidence.reported_causes import Cause
from diagnosis.model.workspace import Workspace
from sensors.effects.line_bow import LineBow
from tests.support.effect_case import bench_workspace, taken_with

SECOND_LIGHT = Cause(
    name="interreflection", channel="mean", probability=0.9, alternatives=(),
    none_of_these=0.1, nats=50.0,
)  # fmt: skip


@pytest.fixture(scope="module")
def bent() -> Workspace:
    return taken_with(bench_workspace("domes"), "domes", LineBow(sag_um=40.0))
