"""Booleans of the seams alone: the same solid as with all faces, or none where skin passes."""

from dataclasses import replace

import numpy as np
import pytest
from manifold3d import Manifold

from defects.carving.block import Block
from defects.carving.booleans import solid_of
from defects.carving.stitch import is_closed
from defects.kinds.dent import Dent
from defects.kinds.scratch import Scratch
from defects.surface.surface import Site, Surface

DENT = Dent(length_mm=12.0, aspect=0.8, depth_mm=1.0, rim_ratio=0.1)
SCRATCH = Scratch(
    length_mm=12.0, width_mm=0.4, depth_mm=0.05, burr_ratio=0.3, burr_width=0.6, burr_side=0.2,
    section=2.0, bow_deg=5.0,
)  # fmt: skip


def plate(thickness_mm=10.0, *holes):
    body = Manifold.cube((40.0, 40.0, thickness_mm)).translate((-20.0, -20.0, -thickness_mm))
    for hole in holes:
        body -= hole
    return solid_of(body)


def ball(radius_mm, depth_mm):
    return Manifold.sphere(radius_mm, 32).translate((0.3, 0.2, -depth_mm))


def cut(solid, kind):
    """Return block and cutter of a flaw in the middle of a solid's top."""
    surface = Surface.of(solid.vertices_mm, solid.faces)
    _, _, triangle = surface.project(np.zeros((1, 3)))
    site = Site(
        position_mm=np.zeros(3), normal=np.array([0.0, 0.0, 1.0]), heading_rad=0.3,
        triangle=int(triangle[0]),
    )  # fmt: skip
    cutter = kind.cutter(surface, site, np.random.default_rng(1), 0.001)
    return Block(solid.vertices_mm, solid.faces), cutter


@pytest.mark.parametrize("kind", [DENT, SCRATCH])
@pytest.mark.parametrize("thickness_mm", [10.0, 0.8])
def test_the_same_faces_from_the_seam_alone(kind, thickness_mm):
    block, cutter = cut(plate(thickness_mm), kind)
    one, other = block.trial(cutter), block.trial(replace(cutter, seam=None))
    assert one.seam is not None
    assert other.seam is None
    for key in ("removed_mm3", "added_mm3", "opening_mm2", "depth_mm"):
        assert getattr(one, key) == pytest.approx(getattr(other, key), rel=1e-9)
    stitched, whole = block.carve([cutter], [one]), block.carve_whole([cutter], [other])
    assert is_closed(stitched.faces)

    def flaw(carved):
        return {tuple(vertex) for vertex in carved.vertices_mm[carved.faces[carved.instance > 0]]
                .reshape(-1, 3).round(9)}  # fmt: skip

    assert flaw(stitched) == flaw(whole)
    # The boolean had but a part of these faces.
    assert len(one.seam.raised.faces) > 2 * int(one.seam.raised.standing.sum())


@pytest.mark.parametrize(
    ("radius_mm", "depth_mm"),
    [(0.2, 0.45), (0.2, 0.9), (0.3, 0.3), (0.3, 1.0)],
    ids=["between stand-in and floor", "through the floor", "near the skin", "at the floor"],
)
def test_skin_that_passes_between_is_found(radius_mm, depth_mm):
    block, cutter = cut(plate(10.0, ball(radius_mm, depth_mm)), DENT)
    one, other = block.trial(cutter), block.trial(replace(cutter, seam=None))
    assert one.seam is None
    assert one.removed_mm3 == other.removed_mm3
    clear, same = cut(plate(10.0), DENT)
    assert clear.trial(same).removed_mm3 > one.removed_mm3


def test_a_hole_below_the_flaw_changes_nothing():
    block, cutter = cut(plate(10.0, ball(0.5, 3.0)), DENT)
    assert block.trial(cutter).seam is not None
