"""The contract of every kind of flaw, on a plate, a cylinder, a sphere and a bent sheet."""


import numpy as np
import pytest

from defects.carving.block import Block
from defects.carving.solid import Solid
from defects.kinds import KINDS
from defects.kinds.crack import TIP, Crack
from defects.seats.seat import Edge, Skin
from defects.surface.surface import Site, SiteError, tangent_axes
from tests.support.reliefs import hollow_and_rim

SIZES = {
    "dent": {"length_mm": 5.0, "aspect": 0.7, "depth_mm": 0.3, "rim_ratio": 0.1},
    "crack": {
        "length_mm": 12.0, "opening_mm": 0.2, "depth_mm": 0.35, "meander": 0.8, "branches": 2.0,
    },
    "pit": {
        "diameter_mm": 1.5, "depth_mm": 0.3, "irregularity": 0.1, "steepness": 3.0, "pits": 3.0,
        "spread_mm": 1.5,
    },
    "scratch": {
        "length_mm": 14.0, "width_mm": 0.5, "depth_mm": 0.12, "burr_ratio": 0.3,
        "burr_width": 0.6, "burr_side": 0.4, "section": 1.7, "bow_deg": 8.0,
    },
    "bump": {
        "length_mm": 2.0, "aspect": 0.7, "height_mm": 0.5, "fullness": 2.5,
        "irregularity": 0.08, "droplets": 2.0, "spread_mm": 1.5,
    },
    "edge_chip": {
        "length_mm": 4.0, "reach_mm": 1.2, "aspect": 0.6, "hollow": 0.3, "irregularity": 0.08,
        "ripple": 0.03,
    },
    "edge_burr": {
        "length_mm": 8.0, "height_mm": 0.3, "root_mm": 0.15, "lean_deg": 15.0, "raggedness": 0.5,
    },
    "corrosion": {
        "length_mm": 8.0, "aspect": 0.7, "depth_mm": 0.3, "growth": 0.4, "width_ratio": 4.0,
        "cover": 0.6, "loss_ratio": 0.08,
    },
    "undercut": {"length_mm": 10.0, "width_mm": 1.5, "depth_mm": 0.4, "unevenness": 0.1},
    "lack_of_fusion": {"length_mm": 8.0, "opening_mm": 0.3, "depth_mm": 0.6, "unevenness": 0.1},
    "porosity": {
        "diameter_mm": 1.0, "depth_ratio": 0.3, "pores": 4.0, "spread_mm": 2.0, "row": 0.8,
        "scatter": 0.3,
    },
    "spatter": {
        "diameter_mm": 1.2, "height_ratio": 0.4, "drops": 4.0, "spread_mm": 3.0, "scatter": 0.4,
    },
    "wear": {
        "length_mm": 12.0, "land_mm": 0.8, "tilt": 0.3, "runout": 0.4, "groove_ratio": 0.03,
    },
    "missing_feature": {"ratio": 0.0, "depth_share": 0.6},
    "bank": {
        "which": 0.0, "scale": 1.5, "height_ratio": 1.2, "mirror": 1.0, "bend_deg": 12.0,
        "bank": hollow_and_rim(),
    },
}  # fmt: skip
DEPTHS = {"porosity": 0.3, "spatter": 0.48, "bank": 0.36}
"""Depth or height with the sizes above, mm, where no size of the kind says it."""
SKIN = ("plate", "cylinder", "sphere", "bent")
SHAPES = {
    Skin(): SKIN,
    Edge(convex=True): ("plate", "cylinder", "ridge"),
    Edge(convex=False): ("ridge", "drilled"),
}
"""Shapes that have a place for a seat; all others sit on the rims of holes."""
EVERYWHERE = [
    (kind, name) for kind, cls in KINDS.items() for name in SHAPES.get(cls.seat, ("drilled",))
]
ON_SKIN = [kind for kind, cls in KINDS.items() if cls.seat == Skin()]
ADD_TOO = ("dent", "scratch", "bank")  # they have a rim or a burr beside what they remove


def flaw_of(kind):
    """Return a flaw of a kind: with the sizes above, or of the middle of the typical ones."""
    cls = KINDS[kind]
    middle = {size.name: 0.5 * sum(size.typical) for size in cls.sizes()}
    middle |= {size.name: round(middle[size.name]) for size in cls.sizes() if size.whole}
    return cls(**SIZES.get(kind, middle))


def elevation(name, points, surfaces):
    """Return how far points stand above the ideal surface, negative below."""
    if name == "plate":
        return points[:, 2]
    if name == "cylinder":
        return np.hypot(points[:, 0], points[:, 1]) - 20.0
    if name == "sphere":
        return np.linalg.norm(points, axis=1) - 25.0
    onto, normals, _ = surfaces[name].project(points)
    return np.sum((points - onto) * normals, axis=1)


def outside(name, surface):
    """Return the faces that flaws go on: not the ends of the cylinder, not the plate's sides."""
    if name == "cylinder":
        return np.abs(surface.normals[:, 2]) < 0.5
    if name in ("sphere", "ridge", "drilled"):
        return np.ones(len(surface.faces), bool)
    return surface.normals[:, 2] > 0.3


def fit(kind, surface, block, name, seed):
    """Return a cutter and its change at the first of some random places where it fits."""
    rng = np.random.default_rng(seed)
    for site in kind.seat.sites(surface, rng, 40, outside(name, surface).astype(float)):
        try:
            cutter = kind.cutter(surface, site, np.random.default_rng(seed))
        except SiteError:
            continue
        return site, cutter, block.trial(cutter)
    raise AssertionError("fits nowhere: give it smaller sizes in SIZES")


def built(flaw, surface, site, seeds):
    """Return the cutter of the first seed with which the flaw fits at a site."""
    for seed in seeds:
        try:
            return flaw.cutter(surface, site, np.random.default_rng(seed))
        except SiteError:
            continue
    raise AssertionError("no seed fits")


@pytest.mark.parametrize("name", SKIN)
@pytest.mark.parametrize("kind", ON_SKIN)
def test_depth_along_the_local_normal(kind, name, solids, surfaces):
    solid, surface = solids[name], surfaces[name]
    block = Block(solid.vertices_mm, solid.faces)
    flaw = flaw_of(kind)
    _, cutter, change = fit(flaw, surface, block, name, 3)
    carved = block.carve([cutter], [change])
    made = carved.vertices_mm[np.unique(carved.faces[carved.instance == 1])]
    height = elevation(name, made, surfaces)
    # The mesh itself lies up to its facets' sagitta under the ideal surface.
    sagitta = {"plate": 0.0, "cylinder": 0.0007, "sphere": 0.02, "bent": 0.0}[name]
    sizes = flaw.parameters()
    wanted_mm = DEPTHS.get(kind) or sizes.get("depth_mm") or sizes.get("height_mm")
    assert wanted_mm, "no depth_mm and no height_mm: state its depth in DEPTHS"
    if cutter.removed is None:
        assert height.max() == pytest.approx(change.depth_mm, rel=0.05, abs=sagitta)
        assert change.depth_mm == pytest.approx(wanted_mm, rel=0.02)
        assert change.removed_mm3 == 0
    else:
        assert -height.min() == pytest.approx(change.depth_mm, rel=0.05, abs=sagitta)
        assert change.depth_mm == pytest.approx(wanted_mm, rel=0.2)
        assert change.removed_mm3 > 0
    assert (change.added_mm3 > 0) == (cutter.added is not None)
    assert change.added_mm3 > 0 or kind not in ADD_TOO
    # All along, not only at the deepest point: the wanted surface against the part's mesh.
    deep = np.abs(cutter.height_mm) > 0.2 * np.abs(cutter.height_mm).max()
    wanted = (cutter.skin_mm + cutter.height_mm[:, None] * cutter.normals)[deep]
    onto, _, _ = surface.project(wanted)
    measured = np.linalg.norm(wanted - onto, axis=1)
    np.testing.assert_allclose(measured, np.abs(cutter.height_mm[deep]), rtol=0.05)


@pytest.mark.parametrize(("kind", "name"), EVERYWHERE)
def test_carved_parts_are_closed_and_their_faces_know_the_flaw(kind, name, solids, surfaces):
    """Volumes add up, the part's vertices keep their bits, and skin stays skin."""
    solid, surface = solids[name], surfaces[name]
    block = Block(solid.vertices_mm, solid.faces)
    _, cutter, change = fit(flaw_of(kind), surface, block, name, 5)
    carved = block.carve([cutter], [change])
    after = Solid(vertices_mm=carved.vertices_mm, faces=carved.faces)
    assert after.closed
    grown = after.volume_mm3 - solid.volume_mm3
    assert grown == pytest.approx(change.added_mm3 - change.removed_mm3, abs=1e-6)
    assert (change.removed_mm3 == 0) == (cutter.removed is None)
    kept = {tuple(vertex) for vertex in carved.vertices_mm}
    low, high = cutter.box_mm
    away = ((solid.vertices_mm < low) | (solid.vertices_mm > high)).any(axis=1)
    assert all(tuple(vertex) in kept for vertex in solid.vertices_mm[away])
    made = carved.faces[carved.instance == 1]
    middle = carved.vertices_mm[made].mean(axis=1)
    assert ((middle > low - 1e-9) & (middle < high + 1e-9)).all()
    # What counts as skin lies on the old skin (slivers of a drilled plate are single precision).
    skin = carved.vertices_mm[carved.faces[carved.instance == 0]].mean(axis=1)
    onto, _, _ = surface.project(skin)
    assert np.linalg.norm(onto - skin, axis=1).max() < 1e-7
    assert len(made) > 0


@pytest.mark.parametrize(("kind", "name"), EVERYWHERE)
def test_cutters_are_closed_and_repeat_from_the_seed(kind, name, solids, surfaces):
    flaw, surface, solid = flaw_of(kind), surfaces[name], solids[name]
    site, one, _ = fit(flaw, surface, Block(solid.vertices_mm, solid.faces), name, 4)
    rng = np.random.default_rng(4)
    other = flaw.cutter(surface, site, rng)
    for part, again in zip(one.solids, other.solids, strict=True):
        assert part.closed
        assert part.volume_mm3 > 0
        np.testing.assert_array_equal(part.vertices_mm, again.vertices_mm)
        np.testing.assert_array_equal(part.faces, again.faces)
    if rng.bit_generator.state != np.random.default_rng(4).bit_generator.state:
        third = built(flaw, surface, site, range(6, 30))
        assert any(
            part.vertices_mm.shape != again.vertices_mm.shape
            or not np.array_equal(part.vertices_mm, again.vertices_mm)
            for part, again in zip(one.solids, third.solids, strict=True)
        ), "it draws from rng, and another seed gives the same shape"


def test_crack_across_a_bend_keeps_the_tapered_depth(solids, surfaces):
    solid, surface = solids["bent"], surfaces["bent"]
    crack = Crack(length_mm=22.0, opening_mm=0.15, depth_mm=0.3, meander=0.5, branches=0.0)
    # From the upper flat over the convex bend, down the wall of 65 degrees, over the concave one.
    onto, normals, triangles = surface.project(np.array([[7.6, 0.0, -7.0]]))
    first, second = tangent_axes(normals[0])
    across = np.arctan2(second[0], first[0])
    site = Site(
        position_mm=onto[0], normal=normals[0], heading_rad=across, triangle=int(triangles[0])
    )
    cutter = crack.cutter(surface, site, np.random.default_rng(2))
    floor = cutter.height_mm < 0
    assert np.degrees(np.arccos(cutter.normals[floor] @ [0, 0, 1])).max() > 60
    points = cutter.skin_mm[floor] + cutter.height_mm[floor, None] * cutter.normals[floor]
    measured = np.linalg.norm(points - surface.project(points)[0], axis=1)
    # Stations are in order along the path; their share of its length gives v.
    step = np.linalg.norm(np.diff(cutter.skin_mm[floor], axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(step)])
    v = 2 * along / along[-1] - 1
    expected = 0.3 * (TIP + (1 - TIP) * (1 - v**4))
    np.testing.assert_allclose(measured, expected, rtol=0.05, atol=0.003)
    block = Block(solid.vertices_mm, solid.faces)
    assert block.trial(cutter).depth_mm == pytest.approx(0.3, rel=1e-6)


def test_crack_pierces_a_sheet(solids, surfaces):
    solid, surface = solids["bent"], surfaces["bent"]
    block = Block(solid.vertices_mm, solid.faces)
    crack = Crack(length_mm=8.0, opening_mm=0.3, depth_mm=1.5, meander=0.5, branches=0.0)
    _, _, change = fit(crack, surface, block, "bent", 1)
    assert change.through
    assert change.depth_mm == pytest.approx(0.8, rel=0.05)
    shallow = Crack(length_mm=8.0, opening_mm=0.3, depth_mm=0.6, meander=0.5, branches=0.0)
    _, _, change = fit(shallow, surface, block, "bent", 1)
    assert not change.through
    assert change.depth_mm == pytest.approx(0.6, rel=0.05)


def test_crack_of_straight_v_has_the_volume_of_its_sections(solids, surfaces):
    """Without meander or branches: the integral of width times depth over two."""
    solid, surface = solids["plate"], surfaces["plate"]
    block = Block(solid.vertices_mm, solid.faces)
    crack = Crack(length_mm=20.0, opening_mm=0.2, depth_mm=0.4, meander=0.0, branches=0.0)
    _, cutter, change = fit(crack, surface, block, "plate", 1)
    n = len(cutter.height_mm) // 3
    left, right = cutter.skin_mm[n : 2 * n], cutter.skin_mm[2 * n :]
    width, depth = np.linalg.norm(left - right, axis=1), -cutter.height_mm[:n]
    steps = np.linalg.norm(np.diff(cutter.skin_mm[:n], axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    assert along[-1] == pytest.approx(20.0, rel=1e-9)
    assert change.removed_mm3 == pytest.approx(np.trapezoid(0.5 * width * depth, along), rel=0.01)
    assert change.opening_mm2 == pytest.approx(np.trapezoid(width, along), rel=0.01)


CLASS_IDS = {
    "dent": 1, "crack": 2, "pit": 3, "scratch": 4, "bump": 5, "edge_chip": 6, "edge_burr": 7,
    "corrosion": 8, "undercut": 9, "lack_of_fusion": 10, "porosity": 11, "spatter": 12,
    "wear": 13, "missing_feature": 14, "bank": 15,
}  # fmt: skip
"""Released labels mean these kinds for ever; a new kind takes the next number."""


def test_class_ids_are_the_contract():
    assert {name: kind.class_id for name, kind in KINDS.items()} == CLASS_IDS, (
        f"enter a new kind in CLASS_IDS; the next free number is {max(CLASS_IDS.values()) + 1}"
    )
    assert len({*CLASS_IDS.values()}) == len(CLASS_IDS)
    for name, kind in KINDS.items():
        assert kind.name == name
        for size in kind.sizes():
            low, high = size.typical
            assert size.low <= low <= high <= size.high


@pytest.mark.parametrize("kind", KINDS)
def test_typical_sizes_draw_within_bounds_and_scale_acts_on_lengths(kind):
    cls = KINDS[kind]
    one = cls.draw(cls.typical(), np.random.default_rng(1))
    half = cls.draw(cls.typical(), np.random.default_rng(1), scale=0.5)
    for size in cls.sizes():
        before, after = getattr(one, size.name), getattr(half, size.name)
        if cls.scaled_by_tier(size):
            assert after == pytest.approx(max(0.5 * before, size.low))
        else:
            assert after == before
        if size.whole:
            assert before == int(before)
