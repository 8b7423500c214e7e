"""Patches closed off: inside the box they are the solid, whatever the solid and the box."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from defects.carving.closed_patch import FaceBoxes, Unclosable, close_off
from defects.carving.stitch import is_closed


def hollow():
    """A ball with a ball-shaped hole in it, and a thin plate beside it."""
    outer = trimesh.creation.icosphere(subdivisions=3, radius=10.0)
    inner = trimesh.creation.icosphere(subdivisions=3, radius=8.0)
    inner.invert()
    plate = trimesh.creation.box((40, 0.5, 30))
    plate.apply_translation((0, 14, 0))
    return trimesh.util.concatenate([outer, inner, plate])


SOLIDS = {
    "hollow ball and plate": hollow(),
    "torus": trimesh.creation.torus(9.0, 3.0, major_sections=60, minor_sections=24),
    "cube": trimesh.creation.box((20, 20, 20)),
    "tube": trimesh.creation.annulus(r_min=6.0, r_max=8.0, height=20.0, sections=40),
}


def winding(triangles, points):
    """Van Oosterom and Strackee's solid angles, over 4 pi."""
    a, b, c = (triangles[None, :, i] - points[:, None] for i in range(3))
    la, lb, lc = (np.linalg.norm(side, axis=2) for side in (a, b, c))
    top = np.einsum("kfi,kfi->kf", a, np.cross(b, c))
    below = la * lb * lc
    for one, other, length in ((a, b, lc), (b, c, la), (c, a, lb)):
        below = below + np.einsum("kfi,kfi->kf", one, other) * length
    return np.arctan2(top, below).sum(axis=1) / (2 * np.pi)


@settings(max_examples=60, deadline=None)
@given(name=st.sampled_from(sorted(SOLIDS)), seed=st.integers(0, 2**32 - 1))
def test_inside_the_box_the_patch_is_the_solid(name, seed):
    mesh = SOLIDS[name]
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces, np.int32)
    rng = np.random.default_rng(seed)
    centre = mesh.triangles_center[rng.integers(len(faces))] + rng.normal(0, 0.3, 3)
    half = np.exp(rng.uniform(np.log(0.2), np.log(6.0), 3))
    box = np.stack([centre - half, centre + half])
    patch = FaceBoxes(vertices, faces).meeting(box)
    corner = vertices[faces]
    meets = (corner.min(axis=1) <= box[1]).all(axis=1) & (corner.max(axis=1) >= box[0]).all(axis=1)
    np.testing.assert_array_equal(patch, np.flatnonzero(meets))
    try:
        closed = close_off(vertices, faces, patch, box)
    except Unclosable:
        return  # boxes without a facet are tested below
    assert is_closed(closed.faces)
    np.testing.assert_array_equal(closed.corners[closed.faces[: len(patch)]], faces[patch])
    own = closed.vertices_mm[: len(closed.corners)]
    np.testing.assert_array_equal(own, vertices[closed.corners])
    points = rng.uniform(*box, (40, 3))
    np.testing.assert_allclose(
        winding(closed.vertices_mm[closed.faces], points), winding(corner, points), atol=1e-6
    )


def test_a_box_that_holds_no_facet_says_so():
    mesh = SOLIDS["cube"]
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces, np.int32)
    boxes = FaceBoxes(vertices, faces)
    for centre in ((0, 0, 0), (30, 0, 0)):
        box = np.array(centre) + np.array([[-1.0] * 3, [1.0] * 3])
        with pytest.raises(Unclosable, match="no face"):
            close_off(vertices, faces, boxes.meeting(box), box)
