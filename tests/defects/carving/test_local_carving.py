"""Carving locally against booleans of the whole part: the same solid, labels and volumes."""

from dataclasses import replace

import numpy as np
import pytest

from defects.carving.block import Block
from defects.carving.solid import BooleanError, Change
from defects.carving.stitch import is_closed
from defects.kinds import KINDS
from pipeline.injection.flawplan import FlawPlan
from pipeline.injection.inject import inject
from pipeline.parts import builtin
from pipeline.parts.part import load_part
from pipeline.seeds import streams

SEEDS = (0, 1)
PLAN = {kind: 1 for kind in KINDS if kind != "bank"}  # a bank has files of its own
SMALL = {
    "min_distance_mm": 0.3,
    "dent": {"number": 2, "length_mm": {"uniform": [1, 3]}, "depth_mm": {"uniform": [0.05, 0.2]}},
    "pit": 2,
    "scratch": {"number": 2, "length_mm": {"uniform": [2, 5]}},
    "bump": {"number": 2, "length_mm": {"uniform": [1, 3]}},
}


SLIVERS = {"removed_mm3": 1e-8, "added_mm3": 1e-8, "opening_mm2": 1e-3, "depth_mm": 0.0}
"""What a pocket's floor cuts off a facetted skin beside its lid, where a seam cuts nothing."""


class WholeBlock(Block):
    """Never finds a patch."""

    def _around(self, box_mm):
        raise BooleanError("no patch")


def areas(carved, count):
    """Return the solid's volume, and its area by instance and by the part's face."""
    corner = carved.vertices_mm[carved.faces]
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    area = np.linalg.norm(cross, axis=1) / 2
    volume = np.einsum("ij,ij->", corner[:, 0] - corner[0, 0], cross) / 6
    return (
        volume,
        np.bincount(carved.instance, area),
        np.bincount(carved.source_face + 1, area, count + 1)[1:],
    )


def hold_against_the_whole(part, plan, seed):
    """Carve both ways and compare; return how many flaws were carved."""
    flawed = inject(part, FlawPlan.from_mapping(plan), rng_of=streams(seed, part.name, "flaws"))
    block = Block(part.vertices_mm, part.faces)
    changes = [
        Change(
            removed_mm3=flaw.removed_mm3,
            added_mm3=flaw.added_mm3,
            opening_mm2=flaw.opening_mm2,
            depth_mm=flaw.depth_mm,
            through=flaw.through,
        )
        for flaw in flawed.flaws
    ]
    if not changes:
        return 0
    local = block.carve_locally(list(flawed.cutters), changes)
    whole = block.carve_whole(list(flawed.cutters), changes)
    assert is_closed(local.faces)
    np.testing.assert_array_equal(local.instance == 0, local.source_face >= 0)
    (volume, by_flaw, by_face), (volume_2, by_flaw_2, by_face_2) = (
        areas(one, len(part.faces)) for one in (local, whole)
    )
    assert volume == pytest.approx(volume_2, rel=1e-9)
    scale = max(1.0, by_face_2.sum())
    np.testing.assert_allclose(by_flaw, by_flaw_2, rtol=1e-9, atol=1e-9 * scale)
    np.testing.assert_allclose(by_face, by_face_2, rtol=1e-9, atol=1e-9 * scale)
    # Vertices of the part stay or go alike, bit by bit.
    before = {tuple(vertex) for vertex in part.vertices_mm}
    kept, kept_2 = (before & {tuple(v) for v in one.vertices_mm} for one in (local, whole))
    assert kept == kept_2
    # So are the records of each flaw alone, up to the areas that slivers at a facet's edge have.
    reference = WholeBlock(part.vertices_mm, part.faces)
    trials = [block.trial(cutter) for cutter in flawed.cutters]
    for cutter, trial in zip(flawed.cutters, trials, strict=True):
        one, other = block.trial(replace(cutter, seam=None)), reference.trial(cutter)
        assert one.through == other.through == trial.through
        for key, sliver in SLIVERS.items():
            value = getattr(other, key)
            assert getattr(one, key) == pytest.approx(value, rel=1e-9, abs=1e-12)
            assert getattr(trial, key) == pytest.approx(value, rel=1e-9, abs=sliver)
    # By their seams the flaws are the same faces, however many share a patch.
    for changes in (trials, [replace(trial, patch=None) for trial in trials]):
        volume, by_flaw, by_face = areas(
            block.carve_locally(list(flawed.cutters), changes), len(part.faces)
        )
        assert volume == pytest.approx(volume_2, rel=1e-9)
        np.testing.assert_allclose(by_flaw, by_flaw_2, rtol=1e-9, atol=SLIVERS["opening_mm2"])
        np.testing.assert_allclose(by_face, by_face_2, rtol=1e-9, atol=SLIVERS["opening_mm2"])
    return len(changes)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(
    "name",
    [
        "steel_plate",
        pytest.param("bearing_cap", marks=pytest.mark.slow),
        pytest.param("car_door", marks=pytest.mark.slow),
    ],
)
def test_built_in_parts(name, seed):
    assert hold_against_the_whole(builtin.build(name, 30.0), PLAN, seed) >= 10


@pytest.mark.slow
def test_real_parts(shared_dir):
    units = {"angle_block.STL": "inch", "ADIS16480.STL": "m", "idler_riser.STL": "inch",
             "octagonal_pocket.stl": "m", "plate_holes.STL": "mm", "torus.STL": "inch",
             "round.stl": "mm", "box.STL": "inch", "cycloidal.ply": "mm"}  # fmt: skip
    carved = {}
    for name, unit in units.items():
        part = load_part(shared_dir / "meshes" / "cad" / name, unit=unit)
        carved[name] = sum(hold_against_the_whole(part, SMALL, seed) for seed in SEEDS)
    assert sum(count > 4 for count in carved.values()) >= 7, carved


def test_the_whole_part_is_what_is_left_when_the_patch_fails():
    part = builtin.build("steel_plate", 30.0)
    flawed = inject(part, FlawPlan.from_mapping({"dent": 2}), rng_of=streams(3, "flaws"))
    block, reference = Block(part.vertices_mm, part.faces), WholeBlock(part.vertices_mm, part.faces)
    changes = [reference.trial(cutter) for cutter in flawed.cutters]
    with pytest.raises(BooleanError, match="no patch"):
        reference.carve_locally(list(flawed.cutters), changes)
    one, other = (some.carve(list(flawed.cutters), changes) for some in (reference, block))
    assert areas(one, len(part.faces))[0] == pytest.approx(
        areas(other, len(part.faces))[0], rel=1e-12
    )
