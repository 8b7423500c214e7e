"""Flaws on edges and holes: volumes against closed forms, and where they may sit."""

import numpy as np
import pytest
import trimesh

from defects.carving.block import Block
from defects.kinds.edge_burr import EdgeBurr
from defects.kinds.edge_chip import EdgeChip
from defects.kinds.missing_feature import MissingFeature
from defects.kinds.wear import Wear
from defects.kinds.weld_toe import LackOfFusion, Undercut
from defects.seats.feature_edges import feature_edges, nearest_edge, site_on_edge
from defects.seats.holes import holes
from defects.seats.seat import Edge, HoleRim
from defects.surface.surface import SiteError, Surface


def on_edge(surface, point, convex=True):
    chain, at = nearest_edge(surface, np.array(point, float), convex)
    return site_on_edge(chain, at)


def change_of(flaw, solid, surface, site, seed=1):
    cutter = flaw.cutter(surface, site, np.random.default_rng(seed))
    return Block(solid.vertices_mm, solid.faces).trial(cutter)


def test_a_box_has_twelve_outer_edges_and_a_ridge_four_inner_ones(surfaces):
    plate = feature_edges(surfaces["plate"])
    assert len(plate) == 12
    assert all(chain.convex and not chain.closed for chain in plate)
    lengths = sorted(round(float(chain.knots_mm[-1])) for chain in plate)
    assert lengths == [10] * 4 + [60] * 4 + [80] * 4
    inner = [chain for chain in feature_edges(surfaces["ridge"]) if not chain.convex]
    assert len(inner) == 4
    assert sum(chain.knots_mm[-1] for chain in inner) == pytest.approx(2 * (50 + 16), rel=1e-6)


def test_rims_run_round_and_frames_are_square(surfaces):
    rims = [chain for chain in feature_edges(surfaces["cylinder"]) if chain.closed]
    assert len(rims) == 2
    for rim in rims:
        length = rim.knots_mm[-1]
        assert length == pytest.approx(2 * np.pi * 20.0, rel=1e-4)
        frames = rim.frames(np.linspace(0.8, 1.2, 40) * length)
        for one, other in ((frames.along, frames.left), (frames.along, frames.outward)):
            np.testing.assert_allclose(np.sum(one * other, axis=1), 0.0, atol=1e-9)
        radial = frames.points_mm * [1, 1, 0] / 20.0
        axial = np.sign(frames.points_mm[:, 2:]) * [0, 0, 1]
        np.testing.assert_allclose(frames.outward, (radial + axial) / np.sqrt(2), atol=0.02)
        both = frames.left + frames.right
        np.testing.assert_allclose(both, -radial - axial, atol=0.02)
    with pytest.raises(SiteError, match="longer than the edge"):
        rims[0].frames(np.linspace(0, length, 5))


def test_chip_of_a_square_edge_has_the_closed_forms_volume(solids, surfaces):
    chip = EdgeChip(
        length_mm=4.0, reach_mm=1.0, aspect=1.0, hollow=0.0, irregularity=0.0, ripple=0.0
    )
    solid, surface = solids["plate"], surfaces["plate"]
    change = change_of(chip, solid, surface, on_edge(surface, (3, 30, 0)))
    assert change.removed_mm3 == pytest.approx(4 * 1.0 * 4.0 / 15, rel=0.01)
    assert change.depth_mm == pytest.approx(1 / np.sqrt(2), rel=0.01)
    # The skin that goes: on both faces 2/3 of the length times the reach.
    assert change.opening_mm2 == pytest.approx(2 * (2 / 3) * 4.0, rel=0.01)


@pytest.mark.parametrize("aspect", [0.3, 0.7])
def test_chip_reaches_on_both_faces_as_far_as_it_says(aspect, solids, surfaces):
    chip = EdgeChip(
        length_mm=5.0, reach_mm=1.5, aspect=aspect, hollow=0.4, irregularity=0.0, ripple=0.0
    )
    solid, surface = solids["plate"], surfaces["plate"]
    cutter = chip.cutter(surface, on_edge(surface, (3, 30, 0)), np.random.default_rng(2))
    block = Block(solid.vertices_mm, solid.faces)
    carved = block.carve([cutter], [block.trial(cutter)])
    made = carved.vertices_mm[np.unique(carved.faces[carved.instance == 1])]
    reach = sorted([30 - made[:, 1].min(), -made[:, 2].min()])
    # A hollowed floor reaches a little further between the two cuts.
    assert reach[1] == pytest.approx(1.5, rel=0.06)
    assert reach[0] == pytest.approx(1.5 * aspect, rel=0.12)
    assert np.ptp(made[:, 0]) == pytest.approx(5.0, rel=0.05)


def test_burr_has_the_volume_of_its_section(solids, surfaces):
    burr = EdgeBurr(length_mm=20.0, height_mm=0.4, root_mm=0.2, lean_deg=0.0, raggedness=0.0)
    solid, surface = solids["plate"], surfaces["plate"]
    change = change_of(burr, solid, surface, on_edge(surface, (0, 30, 0)))
    # Height h (1 - max(|u|, v^4)) over roots u: sections h w/√2 (1 - v^8), v from -1 to 1.
    expected = 0.4 * 0.2 / np.sqrt(2) * 10.0 * 2 * (1 - 1 / 9)
    assert change.added_mm3 == pytest.approx(expected, rel=0.01)
    assert change.depth_mm == pytest.approx(0.4, rel=0.01)


def test_wear_leaves_a_plane_land(solids, surfaces):
    wear = Wear(length_mm=20.0, land_mm=1.0, tilt=0.0, runout=0.2, groove_ratio=0.0)
    solid, surface = solids["plate"], surfaces["plate"]
    site = on_edge(surface, (0, 30, 0))
    change = change_of(wear, solid, surface, site)
    # Section land²/4, times (1 - fade²)² over the run-out: 8/15 of its length.
    assert change.removed_mm3 == pytest.approx(0.25 * (16.0 + 4.0 * 8 / 15), rel=0.01)
    assert change.depth_mm == pytest.approx(0.5, rel=1e-6)


def test_groove_along_an_inner_edge_has_its_depth_and_section(solids, surfaces):
    site = on_edge(surfaces["ridge"], (0.0, 8.0, 0.0), convex=False)
    undercut = Undercut(length_mm=20.0, width_mm=1.0, depth_mm=0.3, unevenness=0.0)
    change = change_of(undercut, solids["ridge"], surfaces["ridge"], site)
    assert change.depth_mm == pytest.approx(0.3, rel=1e-3)
    # Depth d (1 - v⁴ - u²) along the bisector; the faces, r long, stand 67.5° to it.
    across = 0.5 * np.cos(np.deg2rad(22.5))
    ends = np.mean((1 - np.linspace(0, 1, 4001) ** 4) ** 1.5)
    volume = 20.0 * (4 / 3) * across * 0.3 * ends
    assert change.removed_mm3 == pytest.approx(volume, rel=0.02)
    gap = LackOfFusion(length_mm=10.0, opening_mm=0.2, depth_mm=0.8, unevenness=0.0)
    change = change_of(gap, solids["ridge"], surfaces["ridge"], site)
    assert change.depth_mm == pytest.approx(0.8, rel=1e-3)


def test_holes_are_found_with_radius_and_depth_and_shafts_are_none(surfaces):
    found = {(round(hole.radius_mm, 3), round(hole.depth_mm, 3), hole.through): hole.axis[2]
             for hole in holes(surfaces["drilled"])}  # fmt: skip
    assert set(found) == {(5.0, 6.0, False), (4.0, 10.0, True)}
    assert len(holes(surfaces["drilled"])) == 3  # one that goes through has two rims
    assert holes(surfaces["cylinder"]) == ()


@pytest.mark.parametrize(
    ("at", "radius", "fill"), [((12, 5, 0), 5.0, 6.0), ((-20, 4, 0), 4.0, 6.0)]
)
def test_a_missing_hole_is_filled_level_with_its_face(at, radius, fill, solids, surfaces):
    solid, surface = solids["drilled"], surfaces["drilled"]
    flaw = MissingFeature(ratio=0.0, depth_share=0.6)
    cutter = flaw.cutter(surface, on_edge(surface, at), np.random.default_rng(0))
    block = Block(solid.vertices_mm, solid.faces)
    change = block.trial(cutter)
    circle = 32 * np.sin(2 * np.pi / 64) * radius**2  # of 64 corners
    assert change.added_mm3 == pytest.approx(circle * fill, rel=1e-3)
    carved = block.carve([cutter], [change])
    mesh = trimesh.Trimesh(carved.vertices_mm, carved.faces, process=False)
    down = np.array([[at[0], 0.7, 5.0], [at[0] + 0.5 * radius, 0.3, 5.0]])
    places, _, faces = mesh.ray.intersects_location(
        down, [[0, 0, -1.0]] * 2, multiple_hits=False
    )
    np.testing.assert_allclose(places[:, 2], 0.0, atol=1e-6)
    assert (carved.instance[faces] == 1).all()


@pytest.mark.parametrize("ratio", [0.6, 1.3])
def test_a_hole_of_the_wrong_size_has_that_size(ratio, solids, surfaces):
    solid, surface = solids["drilled"], surfaces["drilled"]
    flaw = MissingFeature(ratio=ratio, depth_share=0.5)
    cutter = flaw.cutter(surface, on_edge(surface, (12, 5, 0)), np.random.default_rng(0))
    block = Block(solid.vertices_mm, solid.faces)
    change = block.trial(cutter)
    ring = 32 * np.sin(2 * np.pi / 64) * 25.0 * (1 - ratio**2)
    if ratio < 1:
        assert change.added_mm3 == pytest.approx(ring * 6.0, rel=1e-3)
    else:
        assert change.removed_mm3 == pytest.approx(-ring * 0.97 * 6.0, rel=1e-3)
    with pytest.raises(SiteError, match="no flaw"):
        MissingFeature(ratio=1.0, depth_share=0.5).cutter(
            surface, on_edge(surface, (12, 5, 0)), np.random.default_rng(0)
        )


def test_edges_are_drawn_by_length_where_they_are_wanted(surfaces):
    surface = surfaces["plate"]
    everywhere = np.ones(len(surface.faces))
    rng = np.random.default_rng(0)
    sites = Edge(convex=True).sites(surface, rng, 4000, everywhere)
    short = np.mean([abs(site.normal[2]) < 0.1 for site in sites])  # the four upright edges
    assert short == pytest.approx(4 * 10 / (4 * (10 + 60 + 80)), abs=4 * np.sqrt(0.067 / 4000))
    top = (surface.normals[:, 2] > 0.5).astype(float)
    sites = Edge(convex=True).sites(surface, rng, 200, top)
    assert all(site.position_mm[2] == pytest.approx(0.0) for site in sites)
    with pytest.raises(SiteError, match="no concave edge"):
        Edge(convex=False).sites(surface, rng, 3, everywhere)
    with pytest.raises(SiteError, match="no edge is left"):
        Edge(convex=True).sites(surface, rng, 3, 0 * everywhere)
    with pytest.raises(SiteError, match="no round hole"):
        HoleRim().sites(surface, rng, 3, everywhere)


def test_a_sphere_has_no_edge(surfaces):
    assert feature_edges(surfaces["sphere"]) == ()
    with pytest.raises(SiteError, match="no convex edge"):
        nearest_edge(surfaces["sphere"], np.zeros(3), True)


def test_boss_is_no_hole():
    plate = trimesh.creation.box((40, 40, 6))
    boss = trimesh.creation.cylinder(radius=5.0, height=20.0, sections=48)
    mesh = trimesh.boolean.union([plate, boss])
    surface = Surface.of(np.array(mesh.vertices, float), np.array(mesh.faces, np.int32))
    assert holes(surface) == ()
