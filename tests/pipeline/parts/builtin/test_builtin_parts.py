"""Built-in parts: closed, within facet_um of the true surface, of the size that was asked for."""

from dataclasses import fields

import manifold3d
import numpy as np
import pytest
import trimesh

from defects.seats.feature_edges import feature_edges
from defects.surface.surface import Surface
from pipeline.parts.builtin import NAMES, build, describe, parameters_of
from pipeline.parts.builtin.steel_plate import SteelPlate, flatness_mm
from pipeline.parts.builtin.welded_plate import WeldedPlate, bead_mm
from pipeline.parts.mesh.bodies import manifold
from pipeline.parts.mesh.self_intersection import crossings
from pipeline.parts.part_error import PartError
from tests.support.built_parts import built, spread


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
