"""Explanations in the making: what is fitted, and what a law needs that the file leaves out."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.evidence.reported_causes import Cause
from diagnosis.explanation import completed, fitted_part, under
from diagnosis.model.model import Model
from diagnosis.physics.assumed_camera import seen_by
from diagnosis.prepare import Prepared
from sensors.effects.interreflection import Interreflection
from tests.support.explained import explained
from tests.support.prepared_parts import ready


@pytest.fixture(scope="module")
def good() -> Prepared:
    return ready([], 12)


def named(name: str) -> Cause:
    return Cause(
        name=name, channel="mean", probability=0.9, alternatives=(), none_of_these=0.1, nats=9.0
    )


def test_readings_held_out_are_fitted_by_nothing(good: Prepared) -> None:
    ws = fitted_part(good.patches, good.noise)
    assert {p.recording for p in ws.patches} == {0, 1}
    assert all(p.fit.any() for p in ws.patches)


def test_a_law_that_needs_nothing_leaves_the_file_as_it_is(good: Prepared) -> None:
    notes: list[str] = []
    recorded, patches = completed(
        good.recorded, good.patches, [named("line_bow")], good.noise, Model(), notes
    )
    assert recorded is good.recorded
    assert patches is good.patches
    assert notes == []


def test_a_camera_that_the_file_leaves_out_is_assumed_and_said(good: Prepared) -> None:
    sheet = replace(good.recorded.datasheet, triangulation_angle_deg=None)
    unstated = replace(good.recorded, datasheet=sheet)
    notes: list[str] = []
    recorded, patches = completed(
        unstated, good.patches, [named("specular_dropout")], good.noise, Model(), notes
    )
    assert recorded.datasheet.triangulation_angle_deg in (20.0, 30.0, 40.0)
    assert recorded.datasheet.camera_side in ("+y", "-y")
    assert "states no triangulation angle" in notes[0]
    for p, given in zip(patches, good.patches, strict=True):
        assert np.array_equal(p.depth_mm, given.depth_mm, equal_nan=True)


def test_another_model_is_seen_by_the_camera_that_was_assumed(good: Prepared) -> None:
    """A law whose camera the file leaves out ended a diagnosis when another cause was renamed."""
    found = explained(good)
    sheet = replace(good.recorded.datasheet, triangulation_angle_deg=None)
    bare = replace(good, patches=tuple(seen_by(good.patches, sheet)))
    again = under(Model().with_effect(Interreflection(weight=0.2)), found, bare)
    assert {p.view.datasheet for p in again.patches} == {found.recorded.datasheet}
    assert again.model.names() == ("interreflection",)
