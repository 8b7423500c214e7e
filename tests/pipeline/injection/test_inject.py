"""Injection: labels, records, distances, repeatability, and what happens when flaws don't fit."""

import pickle

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from defects.carving.block import Block
from defects.carving.solid import BooleanError, Solid
from defects.carving.stitch import is_closed
from defects.surface.surface import Surface
from pipeline.injection.flawplan import FlawPlan, exactly
from pipeline.injection.inject import NO_ROOM, cutter_of, inject
from pipeline.injection.placement import PLACES
from pipeline.parts.builtin import build
from pipeline.parts.part import Part
from pipeline.seeds import streams

EVERY = {"dent": 1, "crack": 1, "pit": 1, "scratch": 1, "bump": 1}


def part_of(mesh, **regions):
    return Part(
        name="test",
        vertices_mm=np.array(mesh.vertices, np.float64),
        faces=np.array(mesh.faces, np.int32),
        regions=regions,
    )


def plate(length=160.0, width=120.0, thickness=8.0):
    mesh = trimesh.creation.box((length, width, thickness))
    mesh.apply_translation((0, 0, -thickness / 2))
    return part_of(mesh)


@pytest.fixture(scope="module")
def top():
    part = plate()
    return Surface.of(part.vertices_mm, part.faces).normals[:, 2] > 0.5


@pytest.fixture(scope="module")
def flawed(top):
    plan = FlawPlan.from_mapping({**EVERY, "dent": 2, "min_distance_mm": 3.0})
    return inject(plate(), plan, rng_of=streams(5, "a"), visible_faces=top)


def test_every_flaw_is_there_recorded_and_labelled(flawed):
    assert [flaw.kind for flaw in flawed.flaws] == [
        "dent", "dent", "crack", "pit", "scratch", "bump",
    ]  # fmt: skip
    assert [flaw.instance for flaw in flawed.flaws] == [1, 2, 3, 4, 5, 6]
    np.testing.assert_array_equal(flawed.classes, [0, 1, 1, 2, 3, 4, 5])
    assert set(np.unique(flawed.instance)) == set(range(7))
    np.testing.assert_array_equal(flawed.instance == 0, flawed.source_face >= 0)
    assert flawed.dropped == ()
    for flaw in flawed.flaws:
        assert flaw.position_mm[2] == 0.0
        np.testing.assert_array_equal(flaw.normal, [0.0, 0.0, 1.0])
        assert flaw.opening_mm2 > 0
        assert flaw.depth_mm > 0
        assert (flaw.removed_mm3 == 0) == (flaw.kind == "bump")
        assert flaw.tier == ""


def test_the_result_is_closed_and_its_volume_is_the_sum_of_the_records(flawed):
    assert is_closed(flawed.faces)
    after = Solid(vertices_mm=flawed.vertices_mm, faces=flawed.faces).volume_mm3
    change = sum(flaw.added_mm3 - flaw.removed_mm3 for flaw in flawed.flaws)
    assert after - 160 * 120 * 8 == pytest.approx(change, abs=1e-6)


def test_skin_stays_where_it_was_and_flaw_faces_lie_at_their_flaw(flawed):
    skin = flawed.vertices_mm[flawed.faces[flawed.instance == 0]].reshape(-1, 3)
    off = np.abs(np.abs(skin) - [80, 60, 8])
    off[:, 2] = np.minimum(off[:, 2], np.abs(skin[:, 2]))
    assert off.min(axis=1).max() < 1e-9
    corners = {tuple(v) for v in flawed.vertices_mm}
    assert all(tuple(v) in corners for v in flawed.part.vertices_mm)
    for flaw, cutter in zip(flawed.flaws, flawed.cutters, strict=True):
        made = flawed.vertices_mm[flawed.faces[flawed.instance == flaw.instance]].reshape(-1, 3)
        low, high = cutter.box_mm
        assert (made >= low - 1e-9).all()
        assert (made <= high + 1e-9).all()


def test_removed_volume_by_points_equals_the_records(flawed):
    rng = np.random.default_rng(0)
    for flaw in flawed.flaws:
        if flaw.removed_mm3 == 0:
            continue
        low, high = flawed.cutters[flaw.instance - 1].box_mm
        high = np.minimum(high, [80, 60, 0])
        points = rng.uniform(low, high, (60000, 3))
        inside = flawed.removed_at(points) == flaw.instance
        box = float(np.prod(high - low))
        spread = box * np.sqrt(inside.mean() * (1 - inside.mean()) / len(points))
        assert inside.mean() * box == pytest.approx(flaw.removed_mm3, abs=4.5 * spread)
    assert (flawed.removed_at(np.full((3, 3), np.nan)) == 0).all()
    assert flawed.removed_at(np.zeros((0, 3))).shape == (0,)


def test_labels_of_a_dent_are_its_analytic_footprint(top):
    sizes = {"length_mm": 20.0, "aspect": 0.6, "depth_mm": 0.8, "rim_ratio": 0.1}
    plan = FlawPlan(kinds=(exactly("dent", **sizes),))
    result = inject(plate(), plan, rng_of=streams(2, "b"), visible_faces=top)
    (flaw,) = result.flaws
    along = np.array([np.cos(0.0), 0.0])
    cutter = result.cutters[0]
    q = float(np.sqrt(0.1) + np.sqrt(1.1))
    heading = cutter.skin_mm[1] - cutter.skin_mm[0]
    along = heading[:2] / np.linalg.norm(heading[:2])
    g = np.linspace(-16, 16, 161)
    xy = np.stack(np.meshgrid(g, g), axis=-1).reshape(-1, 2)
    u, v = xy @ along, xy @ [-along[1], along[0]]
    rho = np.hypot(u / 10.0, v / 6.0)
    points = np.column_stack([flaw.position_mm[:2] + xy, np.zeros(len(xy))])
    # Where the skin was taken away: the hollow.
    clear = np.abs(rho - 1) > 0.004
    np.testing.assert_array_equal((result.removed_at(points) == 1)[clear], (rho < 1)[clear])
    # What a ray from above meets: the hollow and the rim.
    mesh = trimesh.Trimesh(result.vertices_mm, result.faces, process=False)
    origins = points + [0, 0, 20.0]
    hit = mesh.ray.intersects_first(origins, np.tile([0.0, 0.0, -1.0], (len(xy), 1)))
    clear = np.abs(rho - q) > 0.006
    np.testing.assert_array_equal((result.instance[hit] == 1)[clear], (rho < q)[clear])


def test_same_seed_same_bytes_and_one_flaw_can_be_built_alone(flawed, top):
    plan = FlawPlan.from_mapping({**EVERY, "dent": 2, "min_distance_mm": 3.0})
    part = plate()
    again = inject(part, plan, rng_of=streams(5, "a"), visible_faces=top)
    for name in ("vertices_mm", "faces", "instance", "source_face"):
        np.testing.assert_array_equal(getattr(again, name), getattr(flawed, name))
    surface = Surface.of(part.vertices_mm, part.faces)
    for flaw, cutter in zip(flawed.flaws, flawed.cutters, strict=True):
        alone = cutter_of(surface, flaw)
        for one, other in zip(alone.solids, cutter.solids, strict=True):
            np.testing.assert_array_equal(one.vertices_mm, other.vertices_mm)
    other = inject(part, plan, rng_of=streams(6, "a"), visible_faces=top)
    assert not np.array_equal(other.flaws[0].position_mm, flawed.flaws[0].position_mm)
    assert len(pickle.loads(pickle.dumps(flawed)).flaws) == 6


def test_one_more_kind_shifts_no_other_draw(top):
    few = FlawPlan.from_mapping({"dent": 1, "pit": 1})
    more = FlawPlan.from_mapping({"dent": 1, "pit": 1, "bump": 1})
    one, other = (
        inject(plate(), plan, rng_of=streams(8, "c"), visible_faces=top) for plan in (few, more)
    )
    for a, b in zip(one.flaws, other.flaws[:2], strict=True):
        assert a.parameters == b.parameters
        assert a.seed == b.seed


def test_flaws_keep_their_distance():
    plan = FlawPlan.from_mapping(
        {"pit": {"number": 7, "pits": 1, "diameter_mm": 1.0}, "min_distance_mm": 6.0}
    )
    result = inject(plate(30, 20), plan, rng_of=streams(1, "d"))
    assert len(result.flaws) > 4
    assert result.misplaced > 0
    for i, one in enumerate(result.cutters):
        for other in result.cutters[:i]:
            gap = np.linalg.norm(one.skin_mm[:, None] - other.skin_mm[None], axis=2).min()
            assert gap >= 6.0


def test_places_follow_regions_boxes_and_sight(top):
    part = plate()
    down = Surface.of(part.vertices_mm, part.faces).normals[:, 2] < -0.5
    part = Part(
        name="p",
        vertices_mm=part.vertices_mm,
        faces=part.faces,
        regions={"top": top, "bottom": down},
    )
    small = {"number": 6, "pits": 1, "diameter_mm": 1.0}
    below = FlawPlan.from_mapping({"pit": small, "where": ["bottom"]})
    assert all(f.position_mm[2] == -8.0 for f in inject(part, below, rng_of=streams(0)).flaws)
    free = FlawPlan.from_mapping(
        {"pit": small, "keep_free": ["bottom", [[-100, -100, -9], [0, 100, 9]]]}
    )
    result = inject(part, free, rng_of=streams(0))
    assert len(result.flaws) == 6
    for flaw, cutter in zip(result.flaws, result.cutters, strict=True):
        assert cutter.skin_mm[:, 0].min() > 0
        assert flaw.normal[2] != -1.0

    def seen(points):
        return points[:, 1] > 30.0

    visible = inject(
        part, FlawPlan.from_mapping({"pit": small}), rng_of=streams(0),
        visible_faces=top, visible_at=seen,
    )  # fmt: skip
    assert len(visible.flaws) == 6
    assert all(f.position_mm[1] > 30 and f.position_mm[2] == 0 for f in visible.flaws)
    with pytest.raises(ValueError, match="no region 'lid' in this part; it has: top, bottom"):
        inject(part, FlawPlan.from_mapping({"dent": 1, "where": ["lid"]}), rng_of=streams(0))
    with pytest.raises(ValueError, match="visible_faces has shape"):
        inject(part, below.__class__(kinds=()), rng_of=streams(0), visible_faces=np.ones(3))


def test_a_crack_goes_through_a_thin_sheet(top):
    plan = FlawPlan(kinds=(exactly("crack", depth_mm=2.0, opening_mm=0.4, length_mm=15.0),))
    result = inject(plate(60, 50, 0.8), plan, rng_of=streams(4), visible_faces=top)
    (flaw,) = result.flaws
    assert flaw.through
    assert flaw.depth_mm == pytest.approx(0.8, rel=1e-6)
    # The material under the crack's middle is gone from one skin to the other.
    points = np.tile(flaw.position_mm, (5, 1))
    points[:, 2] = np.linspace(0, -0.8, 5)
    assert (result.removed_at(points) == 1).all()
    # It opens both skins: more skin is lost than on a thick plate.
    thick = inject(plate(60, 50, 8.0), plan, rng_of=streams(4), visible_faces=top)
    assert flaw.opening_mm2 > 1.2 * thick.flaws[0].opening_mm2


def test_a_dent_deeper_than_the_sheet_bulges_and_stays_closed(top):
    sizes = {"length_mm": 15.0, "aspect": 0.8, "depth_mm": 1.5, "rim_ratio": 0.05}
    plan = FlawPlan(kinds=(exactly("dent", **sizes),))
    result = inject(plate(60, 50, 0.8), plan, rng_of=streams(4), visible_faces=top)
    (flaw,) = result.flaws
    assert not flaw.through
    assert flaw.depth_mm == pytest.approx(1.5)
    made = result.vertices_mm[result.faces[result.instance == 1]].reshape(-1, 3)
    assert made[:, 2].min() < -1.5
    mesh = trimesh.Trimesh(result.vertices_mm, result.faces, process=False)
    assert mesh.is_watertight
    assert mesh.euler_number == 2


def test_a_boolean_that_fails_is_drawn_again_and_counted():
    """In a slot of 0.3 mm a bump of 1 mm always meets the other wall."""
    block = trimesh.creation.box((40, 40, 20))
    slot = trimesh.creation.box((30, 30, 0.3))
    cavity = trimesh.Trimesh(
        np.vstack([block.vertices, slot.vertices]),
        np.vstack([block.faces, slot.faces[:, ::-1] + len(block.vertices)]),
        process=False,
    )
    part = part_of(cavity, slot=np.arange(24) >= 12)
    plan = FlawPlan(
        kinds=(exactly("bump", number=2, length_mm=2.0, height_mm=1.0, droplets=0.0),),
        where=("slot",),
        tries=3,
    )
    result = inject(part, plan, rng_of=streams(0))
    assert result.flaws == ()
    assert result.redrawn == 6
    assert len(result.dropped) == 2
    assert all("another wall" in line for line in result.dropped)
    np.testing.assert_array_equal(result.faces, part.faces)
    np.testing.assert_array_equal(result.source_face, np.arange(24))
    assert (result.removed_at(part.vertices_mm) == 0).all()


def test_a_flaw_that_spoils_the_whole_is_left_out(top, monkeypatch):
    """Should the common boolean fail although each alone passed, the guilty one goes."""
    plan = FlawPlan.from_mapping({"pit": {"number": 3, "pits": 1}})
    good = inject(plate(), plan, rng_of=streams(6), visible_faces=top)
    guilty = good.cutters[1].skin_mm[0]
    carve = Block.carve

    def spoilt(self, cutters, changes):
        if any(np.array_equal(cutter.skin_mm[0], guilty) for cutter in cutters):
            raise BooleanError("the volumes don't add up")
        return carve(self, cutters, changes)

    monkeypatch.setattr(Block, "carve", spoilt)
    result = inject(plate(), plan, rng_of=streams(6), visible_faces=top)
    assert result.dropped == ("pit 1: the volumes don't add up",)
    assert result.redrawn == 1
    assert [flaw.instance for flaw in result.flaws] == [1, 2]
    kept = [good.flaws[0], good.flaws[2]]
    for flaw, before in zip(result.flaws, kept, strict=True):
        np.testing.assert_array_equal(flaw.position_mm, before.position_mm)
    assert set(np.unique(result.instance)) == {0, 1, 2}


def test_a_flaw_larger_than_the_part_is_given_up():
    plan = FlawPlan(kinds=(exactly("dent", length_mm=50.0, aspect=1.0, depth_mm=0.5),))
    result = inject(plate(20, 20), plan, rng_of=streams(0))
    assert result.flaws == ()
    assert result.misplaced == PLACES
    assert result.redrawn == 0
    assert result.dropped == ("dent 0: the flaw would cross an edge of the part",)


def test_a_part_without_room_is_given_up_soon():
    """Thousands of places would be tried for nothing; the rest of the kind is dropped at once."""
    small = {"number": 200, "pits": 1, "diameter_mm": 1.0}
    plan = FlawPlan.from_mapping({"pit": small, "min_distance_mm": 1000.0})
    assert plan.most() == 200
    result = inject(plate(), plan, rng_of=streams(0))
    assert len(result.flaws) == 1
    assert len(result.dropped) == 199
    assert result.misplaced == NO_ROOM * PLACES
    assert result.dropped[-1] == "pit 199: no room; 10 before it found none"


def test_cracks_across_the_doors_recess_keep_their_depth_along_the_normal():
    door = build("car_door", facet_um=100.0)
    sizes = {"length_mm": 30.0, "opening_mm": 0.2, "depth_mm": 0.35, "meander": 0.6}
    plan = FlawPlan(kinds=(exactly("crack", number=4, **sizes),), where=("wall",))
    surface = Surface.of(door.vertices_mm, door.faces)
    result = inject(door, plan, rng_of=streams(3), surface=surface)
    assert len(result.flaws) == 4
    bent = []
    for flaw, cutter in zip(result.flaws, result.cutters, strict=True):
        made = np.unique(result.faces[result.instance == flaw.instance])
        corners = {tuple(v) for v in result.vertices_mm[made]}
        floor = cutter.height_mm < -0.1
        points = (cutter.skin_mm + cutter.height_mm[:, None] * cutter.normals)[floor]
        there = np.array([tuple(p) in corners for p in points])
        assert there.mean() > 0.8  # the rest vanishes where branches join
        onto = surface.project(points[there])[0]
        measured = np.linalg.norm(points[there] - onto, axis=1)
        np.testing.assert_allclose(measured, -cutter.height_mm[floor][there], rtol=0.05)
        turned = cutter.normals[floor] @ cutter.normals[floor].T
        bent.append(np.degrees(np.arccos(np.clip(turned.min(), -1, 1))))
        assert flaw.depth_mm == pytest.approx(0.35, rel=0.001)
    assert max(bent) > 55.0


@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    st.integers(0, 2**63 - 1),
    st.sampled_from(sorted(EVERY)),
    st.floats(12.0, 60.0),
)
def test_any_draw_on_any_sphere_is_closed_and_adds_up(seed, kind, radius):
    sphere = part_of(trimesh.creation.icosphere(subdivisions=4, radius=radius))
    result = inject(sphere, FlawPlan.from_mapping({kind: 2, "facet_um": 4}), rng_of=streams(seed))
    assert is_closed(result.faces)
    before = Solid(vertices_mm=sphere.vertices_mm, faces=sphere.faces).volume_mm3
    after = Solid(vertices_mm=result.vertices_mm, faces=result.faces).volume_mm3
    change = sum(flaw.added_mm3 - flaw.removed_mm3 for flaw in result.flaws)
    assert after - before == pytest.approx(change, abs=1e-9 * before + 1e-7)
    assert set(np.unique(result.instance)) == set(range(len(result.flaws) + 1))
    assert len(result.flaws) + len(result.dropped) == 2
