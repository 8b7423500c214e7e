"""The bearing cap: true bore and holes, a cast skin within facet_um."""

import numpy as np
import pytest

from pipeline.parts.builtin import build
from pipeline.parts.builtin.bearing_cap import BearingCap
from pipeline.parts.builtin.cap_shape import along_bore, arch
from pipeline.parts.part_error import PartError
from tests.support.built_parts import built, spread


def to_polyline(points: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Distance of (k, 2) points from a polyline."""
    best = np.full(len(points), np.inf)
    for a, b in zip(line[:-1], line[1:], strict=True):
        along = b - a
        share = np.clip((points - a) @ along / (along @ along), 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(points - a - share[:, None] * along, axis=1))
    return best


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
