"""The cheap test before the exact one loses no crossing, whatever the triangles are like."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pipeline.parts.mesh import self_intersection
from pipeline.parts.mesh.solid import make_solid
from pipeline.parts.mesh.triangle_pairs import cross, straddling
from pipeline.parts.part_error import PartError

COORDINATE = st.one_of(  # coplanar, collapsed, needles, and anything
    st.integers(-2, 2).map(float), st.floats(-2.0, 2.0), st.sampled_from([1e-9, 1.0 + 1e-9])
)


@settings(deadline=None, max_examples=200)
@given(
    corners=arrays(np.float64, (6, 3, 3), elements=COORDINATE),
    far_mm=st.sampled_from([0.0, 1e3]),
)
def test_no_crossing_is_lost(corners, far_mm):
    corners = corners + far_mm
    pairs = np.array([(i, j) for i in range(6) for j in range(i)])
    hit, _ = cross(corners, pairs, 1e-6)
    kept = straddling(corners, pairs, 1e-6)
    assert not (hit & ~kept).any()


def test_thin_triangles_askew_are_told_apart_cheaply(monkeypatch):
    """A pleated sheet of long triangles at 45 degrees: all boxes overlap, nothing crosses."""
    count = 400
    along = np.arange(count + 1) / count
    zig = 0.01 * (np.arange(count + 1) % 2)
    one = np.stack([along, -along, zig], axis=1)
    other = one + np.array([5.0, 5.0, 0.0])
    vertices = np.concatenate([one, other])
    k = np.arange(count)
    faces = np.concatenate(
        [np.stack([k, k + 1, k + count + 1], axis=1),
         np.stack([k + 1, k + count + 2, k + count + 1], axis=1)]
    )  # fmt: skip
    asked = []

    def counted(corners, pairs, tolerance_mm):
        asked.append(len(pairs))
        return cross(corners, pairs, tolerance_mm)

    monkeypatch.setattr(self_intersection, "cross", counted)
    found = self_intersection.crossings(vertices, faces, tolerance_mm=1e-6)
    assert not len(found.pairs)
    assert found.complete
    assert sum(asked) < 0.01 * len(faces) ** 2 / 2


def test_bodies_that_nearly_coincide_end_in_one_line(monkeypatch):
    """Twin cylinders of long, thin faces askew: nearly every face may cross every other."""
    one = trimesh.creation.cylinder(radius=10.0, height=30.0, sections=400)
    one.apply_transform(trimesh.transformations.rotation_matrix(0.7, [1, 2, 3]))
    other = one.copy()
    other.apply_transform(trimesh.transformations.rotation_matrix(1e-3, [3, 1, 2]))
    both = trimesh.util.concatenate([one, other])
    monkeypatch.setattr(self_intersection, "MOST_PAIRS", 100_000)
    monkeypatch.setattr(self_intersection, "CHUNK", 20_000)
    with pytest.raises(PartError, match="nearly coincide: over 60 million pairs") as refused:
        make_solid("twins.stl", both.vertices, both.faces)
    assert "\n" not in str(refused.value)
    _, faces, _ = make_solid("one.stl", one.vertices, one.faces)  # over the budget, too
    assert len(faces) == len(one.faces)


def test_the_check_says_when_its_budget_ran_out(monkeypatch):
    ball = trimesh.creation.icosphere(subdivisions=3)
    whole = self_intersection.crossings(ball.vertices, ball.faces, tolerance_mm=1e-6)
    assert (whole.complete, whole.over_budget) == (True, False)
    monkeypatch.setattr(self_intersection, "MOST_PAIRS", 10)
    monkeypatch.setattr(self_intersection, "CHUNK", 100)
    short = self_intersection.crossings(ball.vertices, ball.faces, tolerance_mm=1e-6)
    assert (short.complete, short.over_budget) == (False, True)
