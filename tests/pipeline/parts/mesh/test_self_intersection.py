"""The cheap test before the exact one loses no crossing, whatever the triangles are like."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pipeline.parts.mesh import self_intersection
from pipeline.parts.mesh.self_intersection import _cross, _straddling

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
    hit, _ = _cross(corners, pairs, 1e-6)
    kept = _straddling(corners, pairs, 1e-6)
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
        return _cross(corners, pairs, tolerance_mm)

    monkeypatch.setattr(self_intersection, "_cross", counted)
    found = self_intersection.crossings(vertices, faces, tolerance_mm=1e-6)
    assert not len(found.pairs)
    assert found.complete
    assert sum(asked) < 0.01 * len(faces) ** 2 / 2
