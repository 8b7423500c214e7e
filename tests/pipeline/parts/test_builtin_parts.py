"""Built-in parts: closed, within facet_um of the true surface, of the size that was asked for."""

from dataclasses import fields

import manifold3d
import numpy as np
import pytest
import trimesh

from defects.seats.feature_edges import feature_edges
from defects.surface.surface import Surface
from pipeline.parts.builtin import NAMES, build, describe, parameters_of
from pipeline.parts.builtin.bearing_cap import BearingCap
from pipeline.parts.builtin.cap_shape import along_bore, arch
from pipeline.parts.builtin.car_door import CarDoor
from pipeline.parts.builtin.door_shape import DoorShape
from pipeline.parts.builtin.steel_plate import SteelPlate, flatness_mm
from pipeline.parts.builtin.welded_plate import WeldedPlate, bead_mm
from pipeline.parts.mesh.bodies import manifold
from pipeline.parts.mesh.self_intersection import crossings
from pipeline.parts.part import Part
from pipeline.parts.part_error import PartError

_BUILT: dict[tuple[str, float | None], Part] = {}


def built(name: str, facet_um: float | None = None) -> Part:
    """Each part once for all tests."""
    if (name, facet_um) not in _BUILT:
        _BUILT[name, facet_um] = build(name, facet_um)
    return _BUILT[name, facet_um]


def spread(part: Part, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points spread over faces (k, 7, 3) and the faces' unit normals (k, 1, 3)."""
    weights = np.array(
        [(1, 1, 1), (1, 1, 0), (1, 0, 1), (0, 1, 1), (4, 1, 1), (1, 4, 1), (1, 1, 4)], dtype=float
    )
    weights /= weights.sum(axis=1, keepdims=True)
    corners = part.vertices_mm[part.faces[faces]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return np.einsum("pc,kcd->kpd", weights, corners), normal[:, None]


@pytest.mark.parametrize("facet_um", [None, 150.0])
@pytest.mark.parametrize("name", NAMES)
def test_part_is_a_closed_outward_solid(name: str, facet_um: float | None) -> None:
    part = built(name, facet_um)
    mesh = trimesh.Trimesh(part.vertices_mm, part.faces, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    solid = manifold(part.vertices_mm, part.faces)
    assert solid.status() == manifold3d.Error.NoError
    assert len(solid.decompose()) == 1
    assert 0.0 < part.volume_mm3 == pytest.approx(solid.volume(), rel=1e-9)
    assert not len(crossings(part.vertices_mm, part.faces, tolerance_mm=1e-6).pairs)
    assert len(part.faces) < 100_000


@pytest.mark.parametrize("name", NAMES)
def test_frame_and_regions(name: str) -> None:
    part = built(name)
    low, high = part.bounds_mm
    np.testing.assert_allclose(low[:2], -high[:2], atol=1e-6)
    assert low[2] == pytest.approx(0.0, abs=1e-9)
    assert part.name == name
    assert part.source == f"builtin:{name}"
    assert all(mask.any() and not mask.all() for mask in part.regions.values())
    visible = part.regions["outer"]
    corners = part.vertices_mm[part.faces[visible]]
    up = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2]
    # Seen from +z: the sum of the outer faces' shadows is the part's outline, near enough.
    size = high - low
    assert 0.75 * size[0] * size[1] < up.sum() / 2.0 <= size[0] * size[1]


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
@pytest.mark.parametrize("name", NAMES)
def test_any_allowed_size_gives_a_closed_solid(name: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    drawn = {
        size.name: 0.6 * size.default + 0.4 * rng.uniform(size.low, size.high)
        for size in describe(name)
        if not size.name.startswith(
            ("wave", "bolt_spacing", "boss_mm", "width", "edge_r", "bead", "ripple")
        )
    }
    part = build(name, 300.0, **drawn)
    assert manifold(part.vertices_mm, part.faces).volume() == pytest.approx(part.volume_mm3)
    assert not len(crossings(part.vertices_mm, part.faces, tolerance_mm=1e-6).pairs)


@pytest.mark.parametrize("name", NAMES)
def test_no_slivers_and_no_double_vertices(name: str) -> None:
    part = built(name)
    corners = part.vertices_mm[part.faces]
    edges = np.linalg.norm(corners - corners[:, [1, 2, 0]], axis=2)
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    assert (area / edges.max(axis=1)).min() > 1e-4
    assert len(np.unique(part.vertices_mm, axis=0)) == len(part.vertices_mm)


@pytest.mark.parametrize("name", NAMES)
def test_same_bytes_each_time(name: str) -> None:
    again = build(name)
    assert again.vertices_mm.tobytes() == built(name).vertices_mm.tobytes()
    assert again.faces.tobytes() == built(name).faces.tobytes()


@pytest.mark.parametrize("name", NAMES)
def test_parameters_have_bounds_and_keep_them(name: str) -> None:
    for size in describe(name):
        assert size.low <= size.default <= size.high
        assert size.name.endswith({"mm": "_mm", "°": "_deg"}[size.unit])
        assert size.meaning
        for bad in (size.low - 1.0, size.high + 1.0, float("nan")):
            with pytest.raises(PartError, match=f"{size.name} = .*allowed: {size.allowed}"):
                build(name, **{size.name: bad})
    with pytest.raises(PartError, match="facet_um = 0.5"):
        build(name, 0.5)
    with pytest.raises(PartError, match="unknown parameter 'lenght_mm'.*length_mm"):
        build(name, lenght_mm=3.0)
    with pytest.raises(PartError, match="is not a number"):
        build(name, length_mm="long")
    assert len(fields(parameters_of(name))) == len(describe(name))


def test_unknown_part() -> None:
    with pytest.raises(PartError, match="no such built-in part.*car_door"):
        build("teapot")


# ---------------------------------------------------------------------------- steel plate


@pytest.mark.parametrize("facet_um", [5.0, 50.0])
def test_plate_volume(facet_um: float) -> None:
    part = build("steel_plate", facet_um, length_mm=300.0, width_mm=200.0, thickness_mm=25.0)
    exact = 300.0 * (200.0 * 25.0 - (4.0 - np.pi) * 6.0**2)
    # Chords cut off at most facet_um along the four quarter circles.
    lost = exact - part.volume_mm3
    assert 0.0 < lost < 300.0 * 2.0 * np.pi * 6.0 * facet_um * 1e-3


def test_plate_facets_stay_within_sagitta() -> None:
    part = built("steel_plate", 8.0)
    plate = SteelPlate()
    points, _ = spread(part, np.flatnonzero(part.regions["edge"]))
    y = np.abs(points[..., 1]) - (plate.width_mm / 2.0 - plate.edge_radius_mm)
    z = points[..., 2] - (plate.thickness_mm - plate.edge_radius_mm)
    inside = plate.edge_radius_mm - np.hypot(y, z)
    assert inside.min() > -1e-9
    assert 4e-3 < inside.max() <= 8e-3


@pytest.mark.parametrize("facet_um", [10.0, 100.0])
def test_plate_waves_stay_within_facet(facet_um: float) -> None:
    plate = SteelPlate(wave_height_mm=1.5, wave_length_mm=200.0)
    part = build("steel_plate", facet_um, wave_height_mm=1.5, wave_length_mm=200.0)
    points, normal = spread(part, np.flatnonzero(part.regions["face"]))
    true = plate.thickness_mm + flatness_mm(plate, points[..., 0], points[..., 1])
    assert np.abs((points[..., 2] - true) * normal[..., 2]).max() <= facet_um * 1e-3
    assert np.ptp(part.vertices_mm[:, 2]) > plate.thickness_mm + 2.5


def test_plate_sizes_must_fit() -> None:
    with pytest.raises(PartError, match="facet_um = 1 takes .* cells for these waves"):
        build("steel_plate", 1.0, wave_height_mm=10.0, wave_length_mm=100.0)
    with pytest.raises(PartError, match="edge_radius_mm = 20 doesn't fit"):
        build("steel_plate", edge_radius_mm=20.0)


# ---------------------------------------------------------------------------- welded plate


@pytest.mark.parametrize("facet_um", [5.0, 40.0])
def test_bead_has_the_volume_of_a_circular_segment(facet_um: float) -> None:
    part = build("welded_plate", facet_um, length_mm=40.0, width_mm=40.0, ripple_height_mm=0.0)
    half, high = 5.0, 2.0
    radius = (half**2 + high**2) / (2 * high)
    angle = 2 * np.arcsin(half / radius)
    segment = 0.5 * radius**2 * (angle - np.sin(angle))
    lost = 40.0 * 40.0 * 8.0 + 40.0 * segment - part.volume_mm3
    assert 0.0 < lost < 40.0 * radius * angle * facet_um * 1e-3


def test_bead_facets_stay_within_sagitta_and_end_at_the_toes() -> None:
    plate = WeldedPlate(length_mm=30.0, width_mm=30.0)
    part = build("welded_plate", 8.0, length_mm=30.0, width_mm=30.0)
    points, normal = spread(part, np.flatnonzero(part.regions["bead"]))
    true = plate.thickness_mm + bead_mm(plate, points[..., 0], points[..., 1])
    assert np.abs((points[..., 2] - true) * normal[..., 2]).max() <= 8e-3
    toes = [chain for chain in feature_edges(Surface.of(part.vertices_mm, part.faces))
            if not chain.convex]  # fmt: skip
    assert len(toes) == 2
    for toe in toes:
        np.testing.assert_allclose(np.abs(toe.points_mm[:, 1]), 5.0, atol=1e-12)
        np.testing.assert_allclose(toe.points_mm[:, 2], 8.0, atol=1e-12)


def test_beads_that_are_no_welds_are_refused() -> None:
    with pytest.raises(PartError, match="makes a toe of 21 degrees.*34 to 90"):
        build("welded_plate", bead_height_mm=1.0)
    with pytest.raises(PartError, match="doesn't fit the plate"):
        build("welded_plate", bead_width_mm=30.0, width_mm=40.0)
    with pytest.raises(PartError, match="a fifth of the bead's height"):
        build("welded_plate", ripple_height_mm=0.6)
    with pytest.raises(PartError, match="takes .* cells"):
        build("welded_plate", 1.0, length_mm=2000.0)


# ---------------------------------------------------------------------------- car door


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


# ---------------------------------------------------------------------------- bearing cap


def test_cap_bore_and_holes_are_true() -> None:
    cap, part = BearingCap(), built("bearing_cap")
    points, normal = spread(part, np.flatnonzero(part.regions["bore"]))
    wall = (np.abs(normal[:, 0, 1]) < 1e-6) & (np.abs(points[:, 0, 2]) > 5.5)
    inside = cap.bore_mm / 2.0 - np.hypot(points[wall][..., 0], points[wall][..., 2])
    assert inside.max() <= 20e-3
    assert inside.min() > -1e-9
    points, normal = spread(part, np.flatnonzero(part.regions["hole"]))
    wall = np.abs(normal[:, 0, 2]) < 1e-6
    off = np.abs(points[wall][..., 0]) - cap.bolt_spacing_mm / 2.0
    inside = cap.bolt_mm / 2.0 - np.hypot(off, points[wall][..., 1])
    assert inside.max() <= 20e-3
    assert inside.min() > -1e-9


@pytest.mark.parametrize("facet_um", [None, 150.0])
def test_cap_cast_skin_stays_within_facet(facet_um: float | None) -> None:
    part, cap = built("bearing_cap", facet_um), BearingCap()
    allowed = (20.0 if facet_um is None else facet_um) * 1e-3
    crown = cap.bore_mm / 2.0 + cap.wall_mm
    section = along_bore(cap, 1e-4).points_mm
    points, _ = spread(part, np.flatnonzero(part.regions["crown"]))
    x, y, z = np.moveaxis(points, -1, 0)
    # Over the crown the section turns about the bore's axis: compare in (y, radius).
    polar = np.arctan2(np.abs(x), z)
    limit = np.arccos((cap.shoulder_mm + cap.fillet_mm) / (crown + cap.fillet_mm))
    turning = polar.max(axis=1) < limit
    assert turning.sum() > 500
    radius, y = np.hypot(x, z)[turning].ravel(), y[turning].ravel()
    distance = to_polyline(np.stack([y, radius - crown], axis=1), section)
    assert distance.max() <= allowed


def to_polyline(points: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Distance of (k, 2) points from a polyline."""
    best = np.full(len(points), np.inf)
    for a, b in zip(line[:-1], line[1:], strict=True):
        along = b - a
        share = np.clip((points - a) @ along / (along @ along), 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(points - a - share[:, None] * along, axis=1))
    return best


def test_cap_outline_is_tangent_continuous_and_symmetric() -> None:
    pen = arch(BearingCap(), 1e-3)
    np.testing.assert_allclose(pen.points_mm[::-1] * [-1.0, 1.0], pen.points_mm, atol=1e-9)
    step = np.diff(pen.points_mm, axis=0)
    step /= np.linalg.norm(step, axis=1, keepdims=True)
    assert np.degrees(np.arccos(np.clip((step[1:] * step[:-1]).sum(1), -1, 1))).max() < 4.0
    crown = BearingCap().bore_mm / 2.0 + BearingCap().wall_mm
    assert pen.points_mm[:, 1].max() == pytest.approx(crown)


def test_cap_volume_converges_and_changes_with_bore() -> None:
    coarse, fine = built("bearing_cap", 150.0).volume_mm3, built("bearing_cap").volume_mm3
    assert coarse == pytest.approx(fine, rel=5e-3)
    wider = build("bearing_cap", bore_mm=74.0, wall_mm=21.0)
    ring = np.pi / 2.0 * (37.0**2 - 36.0**2) * 44.0
    # The same casting with a wider bore, but for the tang's slot and the chamfers.
    assert fine - wider.volume_mm3 == pytest.approx(ring, rel=0.03)


def test_cap_combinations_that_do_not_fit() -> None:
    with pytest.raises(PartError, match="bolt_spacing_mm is too wide"):
        build("bearing_cap", bolt_spacing_mm=160.0)
    with pytest.raises(PartError, match="leaves no shoulder"):
        build("bearing_cap", width_mm=145.0, wall_mm=30.0)
