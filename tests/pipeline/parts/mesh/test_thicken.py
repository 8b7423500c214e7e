"""Sheet skins grow into solids of area times thickness."""

from pathlib import Path

import manifold3d
import numpy as np
import pytest
import trimesh

from pipeline.parts.mesh.bodies import manifold
from pipeline.parts.mesh.thicken import thicken, vertex_offsets
from pipeline.parts.part import load_part
from pipeline.parts.part_error import PartError


def assert_closed_mesh(vertices: np.ndarray, faces: np.ndarray) -> None:
    solid = manifold(vertices, faces)
    assert solid.status() == manifold3d.Error.NoError
    assert trimesh.Trimesh(vertices, faces, process=False).is_watertight


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    return float(manifold(vertices, faces).volume())


def sheet(columns: int, rows: int, place) -> tuple[np.ndarray, np.ndarray]:
    """Triangulated unit square, mapped by place(u, v) -> (n, 3), normal along d/du x d/dv."""
    u, v = np.meshgrid(np.linspace(0, 1, columns), np.linspace(0, 1, rows), indexing="ij")
    number = np.arange(columns * rows).reshape(columns, rows)
    a, b = number[:-1, :-1].ravel(), number[1:, :-1].ravel()
    c, d = number[1:, 1:].ravel(), number[:-1, 1:].ravel()
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return place(u.ravel(), v.ravel()), faces


def flat(u, v):
    return np.stack([100.0 * u, 60.0 * v, 0.0 * u], axis=1)


def quarter_pipe(u, v):
    """Radius 20, axis along x, outward normals."""
    turn = np.pi / 2.0 * v
    return np.stack([30.0 * u, -20.0 * np.cos(turn), 20.0 * np.sin(turn)], axis=1)


def dome(u, v):
    """Piece of a sphere of radius 50, outward normals."""
    lon, lat = 1.0 * u, 0.2 + 0.8 * v
    return 50.0 * np.stack(
        [np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], axis=1
    )


@pytest.mark.parametrize("thickness", [0.8, -0.8])
def test_flat_sheet(thickness: float) -> None:
    vertices, faces = thicken(*sheet(7, 5, flat), thickness)
    assert_closed_mesh(vertices, faces)
    assert volume(vertices, faces) == pytest.approx(6000.0 * 0.8, rel=1e-12)
    assert np.ptp(vertices[:, 2]) == pytest.approx(0.8)
    # The skin stays; the material grows against its normals (+z), or with them if negative.
    assert vertices[:, 2].mean() == pytest.approx(-thickness / 2.0)


@pytest.mark.parametrize("thickness", [2.0, -2.0])
def test_quarter_pipe(thickness: float) -> None:
    points, faces = sheet(2, 91, quarter_pipe)
    vertices, solid = thicken(points, faces, thickness)
    assert_closed_mesh(vertices, solid)
    inner, outer = sorted((20.0, 20.0 - thickness))
    exact = np.pi / 4.0 * (outer**2 - inner**2) * 30.0
    # The end walls stand square on the last facets, half a degree off the radius.
    assert volume(vertices, solid) == pytest.approx(exact, rel=1e-3)
    radius = np.hypot(vertices[len(points) :, 1], vertices[len(points) :, 2])
    np.testing.assert_allclose(radius, 20.0 - thickness, atol=1e-3)


def test_piece_of_sphere() -> None:
    vertices, faces = thicken(*sheet(60, 50, dome), 1.0)
    assert_closed_mesh(vertices, faces)
    span = np.sin(1.0) - np.sin(0.2)
    assert volume(vertices, faces) == pytest.approx((50.0**3 - 49.0**3) / 3.0 * span, rel=1e-3)


def test_offset_is_exact_at_edge_and_corner() -> None:
    box = trimesh.creation.box((2.0, 2.0, 2.0))
    np.testing.assert_allclose(
        vertex_offsets(np.array(box.vertices), np.array(box.faces)), box.vertices, atol=1e-12
    )


def test_skin_file_needs_thicken_and_takes_it(shared_dir: Path) -> None:
    path = shared_dir / "meshes" / "broken" / "plane.ply"
    with pytest.raises(PartError, match="mend: thicken_mm: "):
        load_part(path)
    part = load_part(path, thicken_mm=0.1)
    assert part.volume_mm3 == pytest.approx(0.4)
    assert part.mended == ("open sheet grown to a solid of 0.1 mm",)


def test_holes_of_a_skin_stay_open(tmp_path: Path) -> None:
    points, faces = sheet(41, 41, flat)
    middle = points[faces].mean(axis=1)
    hole = (np.abs(middle[:, 0] - 50.0) < 2.5) & (np.abs(middle[:, 1] - 30.0) < 1.5)
    path = tmp_path / "skin.ply"
    trimesh.Trimesh(points, faces[~hole], process=False).export(path)
    part = load_part(path, thicken_mm=0.5)
    assert part.volume_mm3 == pytest.approx(0.5 * (6000.0 - 5.0 * 3.0), rel=1e-6)


def test_closed_part_ignores_thicken_and_says_so(tmp_path: Path) -> None:
    path = tmp_path / "box.stl"
    trimesh.creation.box((1.0, 1.0, 1.0)).export(path)
    part = load_part(path, thicken_mm=0.2)
    assert part.volume_mm3 == pytest.approx(1.0)
    assert part.mended == ("already closed: thicken_mm not applied",)


def test_too_thick_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "pipe.ply"
    points, faces = sheet(2, 91, quarter_pipe)
    points[:, 1:] *= 0.1
    trimesh.Trimesh(points, faces, process=False).export(path)
    with pytest.raises(PartError, match="smaller thicken_mm"):
        load_part(path, thicken_mm=6.0)
    with pytest.raises(PartError, match="thicken_mm = 0"):
        load_part(path, thicken_mm=0.0)
    with pytest.raises(PartError, match="thicken_mm = nan"):
        load_part(path, thicken_mm=float("nan"))
