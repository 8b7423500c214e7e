"""Screening of strips, some of which may hold no reading at all."""

from dataclasses import replace

import numpy as np

from diagnosis.families import free_families
from diagnosis.screen import screen_mean
from diagnosis.workspace import Model
from tests.support.effect_case import bench_workspace


def test_a_strip_without_readings_is_passed_over() -> None:
    ws = bench_workspace("wedge")
    one, other = ws.patches
    empty = replace(other, fit=np.zeros(other.shape, dtype=bool))
    patches = [one, other, empty]
    some = replace(ws, patches=tuple(patches))
    states = some.states(some.predict(Model()))
    screening = screen_mean(
        patches, states, free_families(patches), ws.noise, np.random.default_rng(0), draws=12
    )
    assert screening.findings
    assert not screening.significant()
