"""Small scans of simple solids, seen from above by a sensor that travels along the part's +y."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import trimesh

from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet
from sensors.model import SensorModel
from sensors.view.view import View

SHEET: dict[str, Any] = {
    "name": "test",
    "working_distance_mm": 200.0,
    "z_range_mm": 100.0,
    "x_fov_mm": 60.0,
    "points_per_profile": 80,
    "z_resolution_um": 2.0,
    "repeatability_um": 3.0,
    "profile_rate_hz": 100.0,
    "columns": "even_x",
    "triangulation_angle_deg": 30.0,
    "camera_side": "+y",
    "line_width_um": 1200.0,
    "exposure_s": 0.005,
    "camera_rows": 512,
}


def box(size: tuple[float, float, float], middle: tuple[float, float, float]) -> Any:
    solid = trimesh.creation.box(size)
    solid.apply_translation(middle)
    return solid


def plate(thickness: float = 20.0, tilt_y_deg: float = 0.0, tilt_x_deg: float = 0.0) -> Any:
    """Return a plate whose top passes through the origin, tilted: rising along y and along x."""
    solid = box((300.0, 300.0, thickness), (0.0, 0.0, -thickness / 2))
    solid.apply_transform(
        trimesh.transformations.rotation_matrix(np.radians(tilt_y_deg), (1, 0, 0))
    )
    solid.apply_transform(
        trimesh.transformations.rotation_matrix(-np.radians(tilt_x_deg), (0, 1, 0))
    )
    return solid


def step(height: float = 10.0) -> Any:
    """Return a floor at z = 0 with a block of 20 mm along y and 30 mm along x on its middle."""
    floor = box((200.0, 200.0, 20.0), (0.0, 0.0, -10.0))
    block = box((30.0, 20.0, height + 1.0), (0.0, 0.0, height / 2 - 0.5))
    return trimesh.boolean.union([floor, block], engine="manifold")


def end(length: float = 20.0) -> Any:
    """Return a block that ends at y = ±length/2, nothing around it."""
    return box((200.0, length, 20.0), (0.0, 0.0, -10.0))


def cylinder(radius: float = 30.0, sections: int = 16384) -> Any:
    """Return a cylinder lying along x, its top line at z = 0."""
    solid = trimesh.creation.cylinder(radius=radius, height=200.0, sections=sections)
    solid.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, (0, 1, 0)))
    solid.apply_translation((0.0, 0.0, -radius))
    return solid


def groove() -> Any:
    """Return a V groove along x with walls at 45°, its bottom at z = -20, its rims at z = 0."""
    block = box((200.0, 100.0, 60.0), (0.0, 0.0, -30.0))
    cutter = box((300.0, 40.0 * np.sqrt(2), 40.0 * np.sqrt(2)), (0.0, 0.0, 0.0))
    cutter.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 4, (1, 0, 0)))
    cutter.apply_translation((0.0, 0.0, 20.0))
    return trimesh.boolean.difference([block, cutter], engine="manifold")


def bench() -> Any:
    """Return the groove with a block of 30 x 2 x 4 mm on either rim: something for each effect."""
    blocks = [box((30.0, 2.0, 5.0), (0.0, y, 1.5)) for y in (-22.0, 22.0)]
    return trimesh.boolean.union([groove(), *blocks], engine="manifold")


def corner() -> Any:
    """Return a slope that falls at 45° along x down to a wall that stands upright at x = 10."""
    block = box((80.0, 200.0, 60.0), (0.0, 0.0, -30.0))
    outline = np.array([[10.0, 1.0], [10.0, -20.0], [-11.0, 1.0]])
    cutter = trimesh.creation.extrude_triangulation(outline, np.array([[0, 2, 1]]), 300.0)
    turn = np.array([[1.0, 0, 0, 0], [0, 0, -1, 150], [0, 1, 0, 0], [0, 0, 0, 1]])
    cutter.apply_transform(turn)
    if cutter.volume < 0:
        cutter.invert()
    return trimesh.boolean.difference([block, cutter], engine="manifold")


SOLIDS = {
    "corner": corner,
    "bench": bench,
    "plate": plate,
    "step": step,
    "end": end,
    "cylinder": cylinder,
    "groove": groove,
}


@pytest.fixture(scope="session")
def view_of() -> Callable[..., View]:
    """Return a function that scans one of the solids.

    `view_of(name, solid={...}, sheet={...}, turned=False, y_mm=None, **view)`: turned, the sensor
    is turned by 180° about the laser's axis; y_mm are the places of the profiles on the part.
    """
    scenes: dict[str, Scene] = {}

    def make(
        name: str,
        *,
        solid: dict[str, float] | None = None,
        sheet: dict[str, Any] | None = None,
        turned: bool = False,
        y_mm: Any = None,
        height_mm: float = 200.0,
        **more: Any,
    ) -> View:
        key = f"{name}{solid}"
        if key not in scenes:
            mesh = SOLIDS[name](**(solid or {}))
            scenes[key] = Scene(mesh.vertices, mesh.faces)
        y = np.linspace(-25.0, 25.0, 60) if y_mm is None else np.asarray(y_mm, dtype=np.float64)
        poses = np.tile(np.eye(4), (y.size, 1, 1))
        poses[:, :3, :3] = np.diag([1.0, -1.0, -1.0] if turned else [-1.0, 1.0, -1.0])
        poses[:, 1, 3] = y
        poses[:, 2, 3] = height_mm
        time_s = np.arange(y.size) / 100.0
        return View(
            scenes[key], SensorModel(Datasheet(**{**SHEET, **(sheet or {})})), poses, time_s, **more
        )

    return make


@pytest.fixture
def rng_of() -> Callable[[str], np.random.Generator]:
    """Return named streams that start anew at each call."""

    def stream(name: str) -> np.random.Generator:
        return np.random.default_rng([ord(letter) for letter in name])

    return stream
