"""Solids: volumes, unions, points inside, and the checks on what is carved."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from defects.carving.block import Block
from defects.carving.booleans import union
from defects.carving.point_in_mesh import Inside, in_boxes
from defects.carving.solid import BooleanError, Cutter, Solid
from defects.carving.stitch import is_closed


def cube(low, high):
    mesh = trimesh.creation.box(bounds=[low, high])
    return Solid(vertices_mm=np.array(mesh.vertices), faces=np.array(mesh.faces, np.int32))


def cutter(removed=None, added=None, above=None):
    return Cutter(
        removed=removed,
        added=added,
        skin_mm=np.zeros((1, 3)),
        normals=np.array([[0.0, 0.0, 1.0]]),
        height_mm=np.array([-1.0]),
        above_mm=np.zeros((0, 3)) if above is None else np.array(above, float),
    )


def test_volume_and_union():
    one, two = cube((0, 0, 0), (2, 2, 2)), cube((1, 1, 1), (3, 3, 3))
    assert one.volume_mm3 == pytest.approx(8.0, rel=1e-14)
    both = union((one, two))
    assert both.volume_mm3 == pytest.approx(15.0, rel=1e-12)
    assert both.closed
    assert union((one,)) is one


def test_inside_agrees_with_the_solid_angle():
    mesh = trimesh.creation.annulus(r_min=2.0, r_max=5.0, height=3.0, sections=31)
    rng = np.random.default_rng(0)
    points = rng.uniform(-6, 6, (3000, 3))
    # Van Oosterom and Strackee: the solid angle of all faces is 4 pi inside, 0 outside.
    r = mesh.triangles[None] - points[:, None, None]
    size = np.linalg.norm(r, axis=3)
    a, b, c = r[:, :, 0], r[:, :, 1], r[:, :, 2]
    top = np.einsum("kfi,kfi->kf", a, np.cross(b, c))
    below = (
        size.prod(axis=2)
        + np.einsum("kfi,kfi->kf", a, b) * size[:, :, 2]
        + np.einsum("kfi,kfi->kf", b, c) * size[:, :, 0]
        + np.einsum("kfi,kfi->kf", c, a) * size[:, :, 1]
    )
    winding = np.arctan2(top, below).sum(axis=1) / (2 * np.pi)
    inside = Inside.of(np.array(mesh.vertices), np.array(mesh.faces)).contains(points)
    np.testing.assert_array_equal(inside, winding > 0.5)
    assert 0 < inside.sum() < len(points)


def test_points_in_boxes():
    rng = np.random.default_rng(1)
    points = rng.uniform(0, 1, (2000, 3))
    points[7] = np.nan
    low = rng.uniform(0, 0.8, (5, 3))
    boxes = np.concatenate([low, low + 0.3], axis=1)
    start, member = in_boxes(points, boxes)
    for i, box in enumerate(boxes):
        expected = np.flatnonzero(((points >= box[:3]) & (points <= box[3:])).all(axis=1))
        np.testing.assert_array_equal(member[start[i] : start[i + 1]], expected)


def test_trial_measures_what_changes():
    block = Block(*vars_of(cube((0, 0, 0), (10, 10, 10))))
    change = block.trial(cutter(removed=cube((2, 2, 8), (4, 5, 11))))
    assert change.removed_mm3 == pytest.approx(2 * 3 * 2, rel=1e-12)
    assert change.added_mm3 == 0
    assert change.opening_mm2 == pytest.approx(6.0, rel=1e-12)
    change = block.trial(cutter(added=cube((2, 2, 9), (4, 5, 13))))
    assert change.added_mm3 == pytest.approx(2 * 3 * 3, rel=1e-12)
    assert change.removed_mm3 == 0


def vars_of(solid):
    return solid.vertices_mm, solid.faces


def test_failures_are_told():
    part = cube((0, 0, 0), (10, 10, 10))
    block = Block(*vars_of(part))
    with pytest.raises(BooleanError, match="misses"):
        block.trial(cutter(removed=cube((20, 2, 8), (24, 5, 11))))
    with pytest.raises(BooleanError, match="nothing is removed"):
        block.trial(cutter(removed=cube((2, 2, 10.01), (4, 5, 11))))
    with pytest.raises(BooleanError, match="nothing is added"):
        block.trial(cutter(added=cube((2, 2, 5), (4, 5, 6))))
    with pytest.raises(BooleanError, match="another wall"):
        block.trial(cutter(removed=cube((2, 2, 8), (4, 5, 11)), above=[[3, 3, 9]]))
    with pytest.raises(BooleanError, match="nothing is left"):
        block.trial(cutter(removed=cube((-1, -1, -1), (11, 11, 11))))
    hole = cutter(removed=cube((2, 2, 8), (4, 5, 11)))
    with pytest.raises(BooleanError, match="don't add up"):
        block.carve([hole], [replace(block.trial(hole), removed_mm3=11.0)])
    inverted = replace(part, faces=part.faces[:, ::-1].copy())
    with pytest.raises(BooleanError, match="volume"):
        Block(*vars_of(inverted))
    with pytest.raises(BooleanError, match="NotManifold"):
        Block(part.vertices_mm, part.faces[1:])


def test_carving_keeps_bits_and_origins():
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=10.0)
    part = Solid(vertices_mm=np.array(mesh.vertices), faces=np.array(mesh.faces, np.int32))
    block = Block(*vars_of(part))
    cutters = [
        cutter(removed=cube((9.3, -1, -1), (11, 1, 1))),
        cutter(added=cube((-11, -1, -1), (-9.3, 1, 1))),
    ]
    carved = block.carve(cutters, [block.trial(one) for one in cutters])
    skin = carved.source_face >= 0
    np.testing.assert_array_equal(skin, carved.instance == 0)
    assert set(np.unique(carved.instance)) == {0, 1, 2}
    # Each piece of skin lies in the plane of the face that it comes from.
    corners = carved.vertices_mm[carved.faces[skin]]
    source = part.vertices_mm[part.faces[carved.source_face[skin]]]
    normal = np.cross(source[:, 1] - source[:, 0], source[:, 2] - source[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    off = np.einsum("fvi,fi->fv", corners - source[:, :1], normal)
    assert np.abs(off).max() < 1e-11
    # Faces that occur once are untouched: the same corners, bit for bit.
    times = np.bincount(carved.source_face[skin], minlength=len(part.faces))
    whole = times[carved.source_face[skin]] == 1
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    full = np.linalg.norm(
        np.cross(source[:, 1] - source[:, 0], source[:, 2] - source[:, 0]), axis=1
    )
    whole &= np.abs(area / full - 1) < 1e-9
    assert whole.sum() > 0.9 * len(part.faces)
    for one, other in zip(corners[whole], source[whole], strict=True):
        assert {tuple(v) for v in one} == {tuple(v) for v in other}


def test_closedness():
    faces = np.array(trimesh.creation.icosphere(subdivisions=3).faces, np.int32)
    assert is_closed(faces)
    assert is_closed(np.vstack([faces, faces + faces.max() + 1]))
    assert not is_closed(faces[1:])
    assert not is_closed(faces[:0])
    turned = faces.copy()
    turned[7] = turned[7, ::-1]
    assert not is_closed(turned)
    moved = faces.copy()
    moved[5, 1] = (moved[5, 1] + 100) % faces.max()
    assert not is_closed(moved)
    doubled = np.vstack([faces, [[3, 3, 4]]])
    assert not is_closed(doubled)
