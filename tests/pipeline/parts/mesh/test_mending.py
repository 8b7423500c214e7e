"""Each step of mending on meshes whose right answer is known."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from pipeline.parts.mesh import mending
from pipeline.parts.mesh.bodies import manifold
from pipeline.parts.mesh.self_intersection import crossings
from pipeline.parts.mesh.solid import make_solid
from pipeline.parts.part_error import PartError

BOX = trimesh.creation.box((2.0, 2.0, 2.0))


def box(shift=(0.0, 0.0, 0.0), size=2.0, inward=False) -> tuple[np.ndarray, np.ndarray]:
    faces = np.array(BOX.faces)
    return np.array(BOX.vertices) * size / 2.0 + shift, faces[:, ::-1] if inward else faces


def together(*meshes) -> tuple[np.ndarray, np.ndarray]:
    vertices = np.concatenate([mesh[0] for mesh in meshes])
    starts = np.cumsum([0] + [len(mesh[0]) for mesh in meshes])
    return vertices, np.concatenate(
        [mesh[1] + start for mesh, start in zip(meshes, starts[:-1], strict=True)]
    )


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    return float(manifold(vertices, faces).volume())


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_any_soup_of_a_solid_is_mended_to_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ball = trimesh.creation.icosphere(subdivisions=2)
    faces = np.array(ball.faces)
    flip = rng.random(len(faces)) < 0.3
    faces[flip] = faces[flip][:, ::-1]
    soup = np.array(ball.vertices)[faces].reshape(-1, 3)
    order = rng.permutation(len(faces))
    numbers = np.arange(len(soup)).reshape(-1, 3)[order]
    vertices, mended, notes = make_solid("ball", soup, numbers)
    assert len(vertices) == len(ball.vertices)
    assert volume(vertices, mended) == pytest.approx(ball.volume, rel=1e-12)
    assert len(notes) <= 2


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), lost=st.integers(1, 3))
def test_small_holes_are_filled_and_told(seed: int, lost: int) -> None:
    ball = trimesh.creation.icosphere(subdivisions=4)
    faces = np.array(ball.faces)
    gone = np.random.default_rng(seed).choice(len(faces), lost, replace=False)
    # two that touch make one hole, wider than what is filled
    assume(len(np.unique(faces[gone])) == 3 * lost)
    vertices, mended, notes = make_solid("b", np.array(ball.vertices), np.delete(faces, gone, 0))
    assert volume(vertices, mended) == pytest.approx(ball.volume, rel=1e-4)
    assert len(notes) == 1
    assert "small holes filled" in notes[0]


def test_large_hole_is_refused_with_its_place() -> None:
    vertices, faces = box()
    top = vertices[faces][:, :, 2].min(axis=1) > 0.5
    with pytest.raises(PartError, match=r"4 open edges in 1 holes.*\(-1, -1, 1\).*\(1, 1, 1\) mm"):
        make_solid("box", vertices, faces[~top])


def test_cracks_within_rounding_are_welded() -> None:
    vertices, faces = box()
    soup = vertices[faces].reshape(-1, 3)
    soup = soup + np.random.default_rng(5).uniform(-2e-7, 2e-7, soup.shape)
    mended_vertices, mended, notes = make_solid("b", soup, np.arange(36).reshape(-1, 3))
    assert len(mended_vertices) == 8
    assert volume(mended_vertices, mended) == pytest.approx(8.0, rel=1e-6)
    assert any("joined" in note for note in notes)


def test_t_junction_is_closed() -> None:
    vertices, faces = box()
    # Split one face's edge in its middle, leaving its neighbour as it is.
    a, b, c = faces[0]
    vertices = np.concatenate([vertices, [(vertices[a] + vertices[b]) / 2.0]])
    new = len(vertices) - 1
    faces = np.concatenate([faces[1:], [[a, new, c], [new, b, c]]])
    wide, filled, notes = make_solid("b", vertices, faces)
    assert volume(wide, filled) == pytest.approx(8.0)
    corners = wide[filled]
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    assert area.min() > 0.1
    assert "1 slits between faces closed" in notes


def test_inverted_solid_is_turned() -> None:
    vertices, faces, notes = make_solid("b", *box(inward=True))
    assert volume(vertices, faces) == pytest.approx(8.0)
    assert notes == ("1 bodies turned, 1 of them outward",)


@pytest.mark.parametrize("inward", [False, True])
def test_cavity_is_kept(inward: bool) -> None:
    outer, inner = box(inward=inward), box(size=1.0, inward=not inward)
    vertices, faces, _ = make_solid("b", *together(outer, inner))
    assert volume(vertices, faces) == pytest.approx(7.0)


def test_island_in_a_cavity_is_kept_and_solid_in_solid_is_one() -> None:
    hollow = together(box(size=4.0), box(size=3.0, inward=True))
    for inward in (False, True):
        vertices, faces, _ = make_solid("b", *together(hollow, box(inward=inward)))
        assert volume(vertices, faces) == pytest.approx(64.0 - 27.0 + 8.0)
    vertices, faces, notes = make_solid("b", *together(box(size=4.0), box()))
    assert volume(vertices, faces) == pytest.approx(64.0)
    assert notes == ("2 bodies that touch or overlap united",)


def test_nonsense_ends_soon_and_clearly() -> None:
    rng = np.random.default_rng(0)
    soup = rng.uniform(0.0, 100.0, (20_000, 1, 3)) + rng.normal(0.0, 0.5, (20_000, 3, 3))
    with pytest.raises(PartError, match="60000 open edges in 20000 holes"):
        make_solid("soup", soup.reshape(-1, 3), np.arange(60_000).reshape(-1, 3))
    ball = trimesh.creation.icosphere(subdivisions=5)
    crumpled = np.array(ball.vertices) + rng.normal(0.0, 0.1, ball.vertices.shape)
    with pytest.raises(PartError, match="self-intersection: at least "):
        make_solid("crumpled", crumpled, np.array(ball.faces))


def test_crossing_bodies_are_united_with_their_cavity() -> None:
    hollow = together(box(), box(size=1.0, inward=True))
    vertices, faces, notes = make_solid("b", *together(hollow, box((1.5, 0.25, 0.25))))
    # Overlap: 0.5 x 1.75 x 1.75, all of it in the wall of the hollow box.
    assert volume(vertices, faces) == pytest.approx(7.0 + 8.0 - 0.5 * 1.75**2)
    assert notes == ("2 bodies that touch or overlap united",)


def test_bodies_that_share_an_edge_are_taken_apart() -> None:
    vertices, faces = together(box(), box((2.0, 2.0, 0.0)))
    mended_vertices, mended, notes = make_solid("b", vertices, faces)
    assert "1 edges shared by several bodies parted" in notes
    assert volume(mended_vertices, mended) == pytest.approx(16.0)


def test_four_faces_at_an_edge_of_one_body() -> None:
    # A ring of three boxes... closed through a fourth: two of them meet in an edge alone.
    a, b = box((-1.0, -1.0, 0.0)), box((1.0, 1.0, 0.0))
    bridge = box((-1.0, 1.0, 2.0)), box((-1.0, -1.0, 2.0)), box((1.0, 1.0, 2.0))
    whole = manifold(*a)
    for piece in (b, *bridge):
        whole += manifold(*piece)
    mesh = whole.to_mesh64()
    vertices, faces = np.array(mesh.vert_properties), np.array(mesh.tri_verts, dtype=np.int64)
    mended_vertices, mended, notes = make_solid("b", vertices, faces)
    assert notes == ("1 edges shared by several bodies parted",)
    assert volume(mended_vertices, mended) == pytest.approx(40.0)
    _, edge = mending.halfedges(mended)
    assert set(np.bincount(edge)) == {2}


def test_doubled_faces() -> None:
    vertices, faces = box()
    twice = np.concatenate([faces, faces[2:5]])
    _, mended, notes = make_solid("b", vertices, twice)
    assert len(mended) == 12
    assert notes == ("3 doubled faces dropped",)
    fin = np.concatenate([faces, [[0, 1, 8]], [[8, 1, 0]]])
    _, mended, _ = make_solid("b", np.vstack([vertices, [3.0, 0.0, 0.0]]), fin)
    assert len(mended) == 12


def test_moebius_strip_is_one_sided() -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)
    rows = []
    for side in (-0.3, 0.3):
        reach = 2.0 + side * np.cos(turn / 2.0)
        rows.append(
            np.stack([reach * np.cos(turn), reach * np.sin(turn), side * np.sin(turn / 2.0)], 1)
        )
    faces = []
    for k, n in pairwise(range(40)):
        faces += [[k, n, n + 40], [k, n + 40, k + 40]]
    faces += [[39, 40, 0], [39, 0, 79]]
    with pytest.raises(PartError, match="one-sided"):
        make_solid("strip", np.concatenate(rows), np.array(faces), thicken_mm=0.1)


def test_three_faces_at_an_edge() -> None:
    vertices, faces = box()
    fin = np.concatenate([faces, [[faces[0, 0], faces[0, 1], 8]]])
    with pytest.raises(PartError, match="1 edges shared by more than two faces"):
        make_solid("b", np.vstack([vertices, [5.0, 5.0, 5.0]]), fin)


def test_flat_body_has_no_volume() -> None:
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
    with pytest.raises(PartError, match="without volume"):
        make_solid("flat", corners, faces)


def test_fill_loop_is_the_smallest_area() -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    loop = np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], axis=1)
    triangles = mending.fill_loop(loop)
    corners = loop[triangles]
    crossed = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.linalg.norm(crossed, axis=1).sum() / 2.0 == pytest.approx(6.0 * np.sin(np.pi / 6.0))
    assert (crossed[:, 2] > 0.0).all()


def test_crossing_is_found_and_contact_is_not() -> None:
    apart = together(box(), box((2.0, 0.3, 0.3)))
    assert not len(crossings(*apart, tolerance_mm=1e-6).pairs)
    shallow = together(box(), box((2.0 - 1e-7, 0.3, 0.3)))
    assert not len(crossings(*shallow, tolerance_mm=1e-6).pairs)
    deep = together(box(), box((2.0 - 1e-4, 0.3, 0.3)))
    found = crossings(*deep, tolerance_mm=1e-6)
    assert len(found.pairs)
    assert found.complete
    assert (np.abs(found.points_mm[:, 0] - 1.0) < 2e-4).all()


def test_crossings_equal_those_of_all_pairs() -> None:
    rng = np.random.default_rng(11)
    vertices = rng.uniform(0.0, 1.0, (240, 3))
    vertices = vertices[:, None] + rng.normal(0.0, 0.15, (240, 3, 3))
    faces = np.arange(720).reshape(-1, 3)
    found = crossings(vertices.reshape(-1, 3), faces, tolerance_mm=1e-9)
    assert len(found.pairs) == len(np.unique(found.pairs, axis=0)) > 100
    expected = []
    for i in range(240):
        expected += [
            (i, j)
            for j in range(i + 1, 240)
            if any(
                through(vertices[m][[k, (k + 1) % 3]], vertices[n])
                for m, n in ((i, j), (j, i))
                for k in range(3)
            )
        ]
    assert [tuple(pair) for pair in found.pairs.tolist()] == expected


def through(edge: np.ndarray, face: np.ndarray) -> bool:
    """Whether a segment meets a triangle: solve for its barycentric coordinates."""
    system = np.column_stack([face[1] - face[0], face[2] - face[0], edge[0] - edge[1]])
    u, v, t = np.linalg.solve(system, edge[0] - face[0])
    return bool(u > 0 and v > 0 and u + v < 1 and 0 < t < 1)


def test_body_that_crosses_itself_is_refused() -> None:
    ball = trimesh.creation.icosphere(subdivisions=2)
    vertices = np.array(ball.vertices)
    top = np.argmax(vertices[:, 2])
    # One vertex pushed down through the ball and out on the other side.
    vertices[top] = (0.1, 0.05, -1.5)
    with pytest.raises(PartError, match=r"self-intersection: \d+ pairs of faces cross, first at"):
        make_solid("ball", vertices, np.array(ball.faces))


def test_vertices_of_a_sound_mesh_are_not_moved(shared_dir: Path) -> None:
    mesh = trimesh.load(shared_dir / "meshes" / "cad" / "plate_holes.STL", process=False)
    vertices, _, notes = make_solid("p", np.array(mesh.vertices), np.array(mesh.faces))
    assert notes == ()
    np.testing.assert_array_equal(
        np.unique(vertices, axis=0), np.unique(np.array(mesh.vertices) + 0.0, axis=0)
    )
