"""Parts of simple shape with known surfaces, and a probe that reads a mesh's height."""

from collections.abc import Callable

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from defects.carving.solid import Solid
from defects.surface.surface import Surface

Floats = NDArray[np.float64]


def _solid(mesh: trimesh.Trimesh) -> Solid:
    return Solid(
        vertices_mm=np.array(mesh.vertices, np.float64), faces=np.array(mesh.faces, np.int32)
    )


def _channel() -> Solid:
    """Return a sheet 0.8 thick: flat, bent 65° down with radius 6, and back, flat."""
    angle, radius = np.deg2rad(65.0), 6.0
    bends = np.concatenate([np.linspace(0, -angle, 25), np.linspace(-angle, 0, 25)])
    points, normals = [np.array([-15.0, 0.0]), np.array([0.0, 0.0])], [bends[0], bends[0]]
    for i in range(1, len(bends)):
        step = 2 * radius * np.sin(abs(bends[i] - bends[i - 1]) / 2)
        mean = 0.5 * (bends[i] + bends[i - 1])
        step = 8.0 if step == 0 else step
        points.append(points[-1] + step * np.array([np.cos(mean), np.sin(mean)]))
        normals.append(bends[i])
    points.append(points[-1] + np.array([15.0, 0.0]))
    normals.append(0.0)
    line, tilt = np.array(points), np.array(normals)
    away = np.stack([-np.sin(tilt), np.cos(tilt)], axis=1)
    y = np.linspace(-15.0, 15.0, 31)
    rows, columns = len(line), len(y)

    def sheet(offset: float) -> Floats:
        at = line + offset * away
        return np.stack(
            [
                np.repeat(at[:, 0], columns),
                np.tile(y, rows),
                np.repeat(at[:, 1], columns),
            ],
            axis=1,
        )

    node = np.arange(rows * columns).reshape(rows, columns)
    a, b = node[:-1, :-1].ravel(), node[1:, :-1].ravel()
    c, d = node[1:, 1:].ravel(), node[:-1, 1:].ravel()
    top = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    rim = np.concatenate([node[:, 0], node[-1, 1:], node[-2::-1, -1], node[0, -2:0:-1]])
    after, count = np.roll(rim, -1), rows * columns
    walls = np.concatenate(
        [
            np.stack([rim + count, after + count, after], 1),
            np.stack([rim + count, after, rim], 1),
        ]
    )
    faces = np.concatenate([top, top[:, ::-1] + count, walls])
    return Solid(
        vertices_mm=np.concatenate([sheet(0.0), sheet(-0.8)]), faces=faces.astype(np.int32)
    )


@pytest.fixture(scope="session")
def solids() -> dict[str, Solid]:
    """Return simple parts: the plates' tops lie at z = 0, where nothing stands on them."""
    plate = trimesh.creation.box((80.0, 60.0, 10.0))
    plate.apply_translation((0, 0, -5.0))
    # A ridge with flanks of 45 degrees on the plate: two inner edges, as a weld's toes are.
    ends = np.array([[-10, -2], [10, -2], [4, 4], [-4, 4]])
    corners = [(along, y, z) for along in (-25.0, 25.0) for y, z in ends]
    ridge = trimesh.boolean.union([plate, trimesh.convex.convex_hull(corners)])
    drilled = plate
    for x, height, radius in ((-20.0, 30.0, 4.0), (12.0, 12.0, 5.0)):  # through; 6 deep
        drill = trimesh.creation.cylinder(radius=radius, height=height, sections=64)
        drill.apply_translation((x, 0, 0))
        drilled = trimesh.boolean.difference([drilled, drill])
    bent = _channel()
    assert bent.closed
    assert bent.volume_mm3 > 0
    return {
        "plate": _solid(plate),
        "cylinder": _solid(trimesh.creation.cylinder(radius=20.0, height=90.0, sections=400)),
        "sphere": _solid(trimesh.creation.icosphere(subdivisions=5, radius=25.0)),
        "bent": bent,
        "ridge": _solid(ridge),
        "drilled": _solid(drilled),
    }


@pytest.fixture(scope="session")
def surfaces(solids: dict[str, Solid]) -> dict[str, Surface]:
    return {name: Surface.of(solid.vertices_mm, solid.faces) for name, solid in solids.items()}


@pytest.fixture(scope="session")
def probe() -> Callable[[Floats, NDArray[np.int32], Floats], tuple[Floats, NDArray[np.intp]]]:
    """Return a function: greatest height z of a mesh at points (k, 2), and the face there."""

    def look(
        vertices: Floats, faces: NDArray[np.int32], xy: Floats
    ) -> tuple[Floats, NDArray[np.intp]]:
        a, b, c = (vertices[faces[:, i]] for i in range(3))
        e, f = b - a, c - a
        det = e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0]
        up = np.flatnonzero(det > 1e-14)
        a, e, f, det = a[up], e[up], f[up], det[up]
        height, found = np.full(len(xy), np.nan), np.zeros(len(xy), np.intp)
        for k, point in enumerate(xy):
            p = point - a[:, :2]
            u = (p[:, 0] * f[:, 1] - p[:, 1] * f[:, 0]) / det
            v = (e[:, 0] * p[:, 1] - e[:, 1] * p[:, 0]) / det
            hit = np.flatnonzero((u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9))
            z = a[hit, 2] + u[hit] * e[hit, 2] + v[hit] * f[hit, 2]
            best = int(np.argmax(z))
            height[k], found[k] = z[best], up[hit[best]]
        return height, found

    return look
