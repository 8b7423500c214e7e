"""The car door: life-size, doubly curved, hemmed, within facet_um of the true surface."""


import numpy as np
import pytest

from pipeline.parts.builtin import build
from pipeline.parts.builtin.car_door import CarDoor
from pipeline.parts.builtin.door_shape import DoorShape
from pipeline.parts.part import Part
from pipeline.parts.part_error import PartError
from tests.support.built_parts import built, spread


def door_heights(part: Part) -> tuple[DoorShape, np.ndarray]:
    """Give the true surface, and what to take off its coordinates to get the part's."""
    shape = DoorShape(CarDoor())
    grid = np.linspace(-1.0, 1.0, 1025)
    rim = np.concatenate([np.stack([grid, s + 0.0 * grid], 1) for s in (-1.0, 1.0)])
    a, b = np.concatenate([rim, rim[:, ::-1]]).T
    x, y, _, _ = shape.where(a, b)
    skin = part.regions["outer"]
    used = part.vertices_mm[np.unique(part.faces[skin])]
    shift_xy = np.array([x.max() + x.min(), y.max() + y.min()]) / 2.0
    middle = (used[:, :2].max(axis=0) + used[:, :2].min(axis=0)) / 2.0
    shift = shift_xy - middle
    z = shape.height(used[:, 0] + shift[0], used[:, 1] + shift[1])[0]
    return shape, np.array([*shift, np.median(z - used[:, 2])])


def test_door_is_life_size_and_doubly_curved() -> None:
    part = built("car_door")
    size = np.ptp(part.bounds_mm, axis=0)
    assert size[0] > 500.0
    assert size[1] > 450.0
    door = CarDoor()
    shape = DoorShape(door)
    for x, y in ((-200.0, 0.0), (0.0, 60.0), (-300.0, 250.0)):
        step = 1.0
        at = lambda i, j, x=x, y=y: shape.height(np.array([x + i]), np.array([y + j]))[0][0]  # noqa: E731
        assert at(-step, 0.0) + at(step, 0.0) - 2.0 * at(0.0, 0.0) < -1.0 / door.radius_x_mm / 2.0
        assert at(0.0, -step) + at(0.0, step) - 2.0 * at(0.0, 0.0) < 0.0


def test_door_gradient_is_that_of_its_height() -> None:
    shape = DoorShape(CarDoor())
    rng = np.random.default_rng(3)
    x, y = rng.uniform(-430.0, 430.0, 4000), rng.uniform(-270.0, 270.0, 4000)
    near = rng.uniform(-1.0, 1.0, (2, 4000)) * [[110.0], [50.0]]
    x = np.concatenate([x, shape.recess.x_mm + near[0]])
    y = np.concatenate([y, shape.recess.y_mm + near[1]])
    _, z_x, z_y = shape.height(x, y)
    h = 1e-5
    by_x = (shape.height(x + h, y)[0] - shape.height(x - h, y)[0]) / (2.0 * h)
    by_y = (shape.height(x, y + h)[0] - shape.height(x, y - h)[0]) / (2.0 * h)
    np.testing.assert_allclose(z_x, by_x, atol=2e-5)
    np.testing.assert_allclose(z_y, by_y, atol=2e-5)


@pytest.mark.parametrize("facet_um", [None, 150.0])
def test_door_skin_stays_within_facet(facet_um: float | None) -> None:
    part = built("car_door", facet_um)
    shape, shift = door_heights(part)
    skin = np.flatnonzero(part.regions["outer"])
    points, _ = spread(part, skin)
    x, y, z = np.moveaxis(points + shift, -1, 0)
    true, z_x, z_y = shape.height(x, y)
    distance = np.abs(z - true) / np.sqrt(1.0 + z_x**2 + z_y**2)
    assert distance.max() <= (40.0 if facet_um is None else facet_um) * 1e-3
    assert distance.max() > 5e-3


def test_door_is_a_sheet_of_even_thickness() -> None:
    part, sheet = built("car_door"), CarDoor().sheet_mm
    outer, inner = np.split(part.vertices_mm, 2)
    np.testing.assert_allclose(np.linalg.norm(outer - inner, axis=1), sheet, rtol=1e-9)
    # Volume of a thin sheet: the mean of both faces' areas times the thickness.
    corners = part.vertices_mm[part.faces]
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    ).sum() / 2.0
    outline = 2.0 * np.ptp(part.bounds_mm, axis=0)[:2].sum()
    assert part.volume_mm3 == pytest.approx((area - 0.95 * outline * sheet) / 2.0 * sheet, rel=3e-3)


def test_door_recess_walls_and_radii() -> None:
    part = built("car_door", 20.0)
    door = CarDoor()
    wall = part.regions["wall"]
    corners = part.vertices_mm[part.faces[wall]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    steep = np.degrees(np.arccos(normal[:, 2] / np.linalg.norm(normal, axis=1)))
    assert steep.min() >= 60.0
    assert steep.max() < 85.0
    # Radii: bend of the section through the recess's middle, across its long sides.
    shape = DoorShape(door)
    y = shape.recess.y_mm + np.arange(-45.0, 45.0, 0.01)
    z, _, z_y = shape.height(np.full_like(y, shape.recess.x_mm), y)
    bend = np.gradient(z_y, y) / (1.0 + z_y**2) ** 1.5
    radius = 1.0 / np.maximum(np.abs(bend), 1e-9)
    assert radius.min() > 0.9 * min(door.recess_rim_radius_mm, door.recess_floor_radius_mm)
    share_floor = np.mean(radius[(bend > 0.05)] < 6.0)
    share_rim = np.mean(radius[(bend < -0.05)] < 6.0)
    assert share_floor > 0.97
    assert share_rim > 0.97
    assert z.max() - z[len(z) // 2] > 0.8 * door.recess_depth_mm


def test_door_hem_is_folded_back_and_window_edge_down() -> None:
    part = built("car_door")
    door = CarDoor()
    corners = part.vertices_mm[part.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    hem, window = part.regions["hem"], part.regions["window"]
    # Folded by half a turn: the strip's outer face looks down.
    assert normal[hem, 2].min() < -0.9
    flange = window & (np.abs(corners[:, :, 0].mean(axis=1)) < 100.0)
    # The flange stands within ten degrees of upright, the skin's own lean there included.
    assert abs(np.quantile(normal[flange, 2], 0.05)) < np.sin(np.radians(10.0))
    low = corners[hem][:, :, 1].min()
    assert low == pytest.approx(part.bounds_mm[0, 1])
    top = corners[window].reshape(-1, 3)
    middle = np.abs(top[:, 0]) < 100.0
    drop = np.ptp(top[middle, 2])
    assert drop > door.window_radius_mm + 0.9 * door.window_flange_mm


def test_door_combinations_that_do_not_fit() -> None:
    with pytest.raises(PartError, match="hem_radius_mm = 1.5 with a sheet of 1.4 mm"):
        build("car_door", sheet_mm=1.4)
    with pytest.raises(PartError, match="recess_length_mm is less than recess_width_mm"):
        build("car_door", recess_width_mm=110.0, recess_length_mm=100.0)
    with pytest.raises(PartError, match="reaches the panel's edge"):
        build("car_door", length_mm=500.0, recess_length_mm=240.0)
