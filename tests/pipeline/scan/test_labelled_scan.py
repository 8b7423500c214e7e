"""Labels against geometry: every pixel's class follows from the solids, not from thresholds."""

import dataclasses

import numpy as np
import pytest
import trimesh

from defects.kinds import KINDS
from defects.surface.surface import Surface as Skin
from pipeline.parts.part import Part
from pipeline.scan.labelled_scan import HIDDEN_BY_FLAW
from sensors.surface.surface import Surface
from sensors.view.view import Reason
from tests.support.flawed_scan import SHEET, plate, scanned
from tests.support.reliefs import hollow_and_rim


def workpiece():
    """Return a plate with a ridge of 45 degrees and a blind hole: places for every kind."""
    base = trimesh.creation.box(extents=(60, 60, 5))
    ends = np.array([[-2, 1], [-10, 1], [-7, 4.5], [-5, 4.5]])
    corners = [(x, y, z) for x in (-25.0, 25.0) for y, z in ends]
    drill = trimesh.creation.cylinder(radius=3.0, height=6.0, sections=64)
    drill.apply_translation((0, 8, 2.5))
    solid = trimesh.boolean.difference(
        [trimesh.boolean.union([base, trimesh.convex.convex_hull(corners)]), drill]
    )
    return Part(name="workpiece", vertices_mm=np.array(solid.vertices), faces=solid.faces)


def upper(part):
    surface = Skin.of(part.vertices_mm, part.faces)
    return surface.normals[:, 2] > 0.3


def clean_points(scan):
    points = scan.laser.points_mm(scan.depth_clean_mm)
    return points @ scan.poses[:, :3, :3].transpose(0, 2, 1) + scan.poses[:, None, :3, 3]


def test_a_dents_mask_is_its_analytic_footprint_to_a_pixels_edge():
    flawed, scan = scanned(plate(), "dent", length_mm=14.0, aspect=0.7, depth_mm=0.8)
    flaw = flawed.flaws[0]
    s = np.sqrt(flaw.parameters["rim_ratio"])
    outer = s + np.sqrt(s * s + 1)
    site = clean_points(scan) - flaw.position_mm
    c, d = np.cos(flaw.heading_rad), np.sin(flaw.heading_rad)
    # tangent axes of the upward normal, as defects.surface.surface makes them
    from defects.surface.surface import tangent_axes

    first, second = tangent_axes(flaw.normal)
    u = site @ (c * first + d * second)
    v = site @ (c * second - d * first)
    a, b = 7.0 * outer, 7.0 * 0.7 * outer
    inside = (u / a) ** 2 + (v / b) ** 2 < 1
    pitch = 40 / 159 * 1.05
    far = np.abs(np.hypot(u / a, v / b) - 1) * b > pitch
    labelled = scan.mask == 1
    assert (labelled == inside)[far].all()
    assert labelled[far].sum() > 500
    assert (scan.instance > 0).sum() == labelled.sum()


SEEN = {
    "dent": {"length_mm": 6.0, "depth_mm": 0.8},
    "crack": {"length_mm": 6.0},
    "scratch": {"length_mm": 6.0, "width_mm": 0.6, "depth_mm": 0.06},
    "corrosion": {"length_mm": 5.0},
    "porosity": {"spread_mm": 1.0},
    "wear": {"length_mm": 8.0},
    "edge_burr": {"length_mm": 8.0},
    "undercut": {"length_mm": 8.0},
    "bank": {"bank": hollow_and_rim(), "scale": 1.0},
}
"""Sizes with which a kind fits on the workpiece and covers readings, beside drawn ones."""


@pytest.mark.parametrize("kind", KINDS)
def test_outside_the_mask_both_depths_agree_to_a_nanometre(kind):
    _, scan = scanned(workpiece(), kind, faces=upper, **SEEN.get(kind, {}))
    assert (scan.mask > 0).sum() > 5, "too few readings: give it sizes in SEEN"
    assert set(np.unique(scan.mask)) == {0, KINDS[kind].class_id}
    both = np.isfinite(scan.depth_ideal_mm) & np.isfinite(scan.depth_clean_mm)
    off = np.abs(scan.depth_ideal_mm - scan.depth_clean_mm)
    assert off[both & (scan.mask == 0)].max() <= 1e-6
    assert off[both & (scan.mask > 0)].max() > 0.01


def test_a_through_crack_is_labelled_where_nothing_returns():
    flawed, scan = scanned(
        plate(0.8), "crack", depth_mm=3.0, width_mm=1.2, length_mm=12.0, branches=0.0
    )
    assert flawed.flaws[0].through
    gone = np.isnan(scan.depth_ideal_mm) & np.isfinite(scan.depth_clean_mm)
    assert gone.sum() > 10
    assert (scan.mask[gone] == 2).all()
    assert (scan.mask_visible[gone] == 2).all()
    assert (scan.invalid_reason[gone] != Reason.VALID).all()


def test_what_a_bump_hides_from_the_camera_has_its_own_reason():
    sheet = dataclasses.replace(SHEET, effects=({"name": "camera_occlusion"},))
    part = plate()
    _, scan = scanned(part, "bump", sheet=sheet, length_mm=6.0, height_mm=2.5)
    shaded = scan.invalid_reason == HIDDEN_BY_FLAW
    assert shaded.any()
    assert np.isnan(scan.depth_mm[shaded]).all()
    _, plain = scanned(part, "bump", length_mm=6.0, height_mm=2.5)
    assert not (plain.invalid_reason == HIDDEN_BY_FLAW).any()
    # the camera is on +y, so the shade lies on the bump's -y side: earlier rows
    rows = np.nonzero(shaded)[0]
    assert rows.mean() < np.nonzero(scan.mask)[0].mean()


def test_visible_means_above_the_noise():
    surface = Surface.load("car_door")
    _, scan = scanned(plate(), "dent", surface=surface, length_mm=12.0, depth_mm=0.5)
    off = np.abs(scan.depth_ideal_mm - scan.depth_clean_mm)
    expected = (scan.mask > 0) & (off > 3 * scan.noise_mm)
    assert ((scan.mask_visible > 0) == expected).all()
    assert 0 < expected.sum() < (scan.mask > 0).sum()


def test_reading_is_rounded_and_as_noisy_as_claimed():
    _, scan = scanned(plate(), "dent", length_mm=8.0, depth_mm=0.5)
    counts = scan.depth_mm / 1e-3
    np.testing.assert_allclose(counts, np.rint(counts), atol=1e-6)
    noise = (scan.depth_mm - scan.depth_ideal_mm)[scan.mask == 0]
    claimed = np.hypot(scan.noise_mm[0, 0], 1e-3 / np.sqrt(12))  # rounding adds its own share
    assert noise.std() == pytest.approx(claimed, rel=0.03)
    assert abs(noise.mean()) < 5 * claimed / np.sqrt(noise.size)
