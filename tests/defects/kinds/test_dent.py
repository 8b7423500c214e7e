"""The dent on a plate against its closed form."""

import numpy as np
import pytest
import trimesh
from scipy.integrate import quad

from defects.carving.block import Block
from defects.carving.solid import Solid
from defects.kinds import KINDS
from defects.kinds.dent import Dent
from defects.surface.surface import Site, SiteError, Surface

DENT = Dent(length_mm=12.0, aspect=0.6, depth_mm=0.5, rim_ratio=0.1)
SITE = Site(
    position_mm=np.array([3.0, -2.0, 0.0]),
    normal=np.array([0.0, 0.0, 1.0]),
    heading_rad=0.7,
    triangle=0,
)


def carved(solids, surfaces, sagitta_mm):
    plate = solids["plate"]
    block = Block(plate.vertices_mm, plate.faces)
    rng = np.random.default_rng(0)
    cutter = DENT.cutter(surfaces["plate"], SITE, rng, sagitta_mm)
    change = block.trial(cutter)
    return change, block.carve([cutter], [change])


@pytest.mark.parametrize("angle", [0.0, 0.5, np.pi / 2, 2.4])
def test_profile_equals_the_formula_to_a_micrometre(solids, surfaces, probe, angle):
    _, result = carved(solids, surfaces, 0.001)
    a, b = 6.0, 3.6
    distance = np.linspace(0.013, 9.0, 120)
    xy = SITE.position_mm[:2] + distance[:, None] * SITE.direction(angle)[:2]
    z, face = probe(result.vertices_mm, result.faces, xy)
    rho = distance * np.hypot(np.cos(angle) / a, np.sin(angle) / b)
    expected = np.where(rho < DENT.outer_ratio, DENT.height_mm(rho), 0.0)
    np.testing.assert_allclose(z, expected, atol=0.0012)
    # The label is the footprint to within a facet's width at its edge.
    clear = np.abs(rho - DENT.outer_ratio) > 0.01
    np.testing.assert_array_equal(
        result.instance[face][clear], (rho < DENT.outer_ratio)[clear].astype(int)
    )


def test_volumes_approach_the_closed_form_as_facets_shrink(solids, surfaces):
    errors = []
    for sagitta_mm in (0.004, 0.001, 0.00025):
        change, _ = carved(solids, surfaces, sagitta_mm)
        errors.append(abs(change.removed_mm3 / DENT.removed_mm3 - 1))
        assert change.depth_mm == pytest.approx(0.5, abs=1e-12)
        footprint = np.pi * 6.0 * 3.6 * DENT.outer_ratio**2
        assert change.opening_mm2 == pytest.approx(footprint, rel=0.02)
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 0.0005
    assert change.added_mm3 == pytest.approx(DENT.added_mm3, rel=0.005)


def test_closed_forms_are_the_integrals():
    a, b, q = 6.0, 3.6, DENT.outer_ratio
    removed = quad(lambda rho: -DENT.height_mm(rho) * 2 * np.pi * a * b * rho, 0, 1)[0]
    added = quad(lambda rho: DENT.height_mm(rho) * 2 * np.pi * a * b * rho, 1, q)[0]
    assert DENT.removed_mm3 == pytest.approx(removed, rel=1e-12)
    assert DENT.added_mm3 == pytest.approx(added, rel=1e-12)
    crest = DENT.height_mm(np.linspace(1, q, 20001)).max()
    assert crest == pytest.approx(DENT.rim_ratio * DENT.depth_mm, rel=1e-7)


def test_a_dent_deeper_than_its_half_width_is_refused(surfaces):
    dent = Dent(length_mm=2.0, aspect=0.5, depth_mm=0.6, rim_ratio=0.1)
    with pytest.raises(SiteError, match="half-width"):
        dent.cutter(surfaces["plate"], SITE, np.random.default_rng(0))


def test_sizes_out_of_bounds_are_refused():
    with pytest.raises(ValueError, match=r"dent: depth_mm is -1\.0, allowed 0\.005 to 20"):
        KINDS["dent"](length_mm=5.0, aspect=0.5, depth_mm=-1.0, rim_ratio=0.1)
    with pytest.raises(ValueError, match="nan"):
        KINDS["dent"](length_mm=float("nan"), aspect=0.5, depth_mm=1.0, rim_ratio=0.1)


@pytest.mark.parametrize(("thickness", "moves"), [(0.8, True), (2.0, True), (4.0, False)])
def test_both_skins_of_a_thin_sheet_move_alike(thickness, moves):
    """The volume stays, but for the rim: what the near skin loses the far skin gains."""
    sheet = trimesh.creation.box((60.0, 50.0, thickness))
    sheet.apply_translation((0, 0, -thickness / 2))
    vertices, faces = np.array(sheet.vertices, float), np.array(sheet.faces, np.int32)
    surface, block = Surface.of(vertices, faces), Block(vertices, faces)
    onto, normals, triangles = surface.project(np.array([[1.0, 2.0, 0.0]]))
    site = Site(
        position_mm=onto[0], normal=normals[0], heading_rad=0.3, triangle=int(triangles[0])
    )
    dent = Dent(length_mm=18.0, aspect=0.9, depth_mm=0.6, rim_ratio=0.05)
    cutter = dent.cutter(surface, site, np.random.default_rng(0))
    carved = block.carve([cutter], [block.trial(cutter)])
    lowest = carved.vertices_mm[:, 2].min()
    grown = Solid(vertices_mm=carved.vertices_mm, faces=carved.faces).volume_mm3
    grown -= 60.0 * 50.0 * thickness
    if moves:
        assert lowest == pytest.approx(-thickness - 0.6, rel=1e-6)
        assert grown == pytest.approx(dent.added_mm3, rel=0.02, abs=0.002 * dent.removed_mm3)
    else:
        assert lowest == -thickness
        assert grown == pytest.approx(dent.added_mm3 - dent.removed_mm3, rel=0.002)
