"""A cast main-bearing cap: an arch over half a bore, two bolt bosses, a rib, machined faces."""

from __future__ import annotations

from dataclasses import dataclass

import manifold3d
import numpy as np

from pipeline.parts.builtin import cap_shape
from pipeline.parts.part import Part
from pipeline.parts.part_error import PartError
from quantity import quantity

DEFAULT_FACET_UM = 20.0


@dataclass(frozen=True, kw_only=True, slots=True)
class BearingCap:
    """Sizes of the cap. The bore runs along y, the joint face is z = 0, the crown points to +z."""

    width_mm: float = quantity(
        "size along x at the joint face", unit="mm", low=140.0, high=260.0, default=184.0
    )
    length_mm: float = quantity("size along the bore", unit="mm", low=38.0, high=90.0, default=44.0)
    bore_mm: float = quantity("diameter of the bore", unit="mm", low=40.0, high=100.0, default=72.0)
    wall_mm: float = quantity("from bore to crown", unit="mm", low=15.0, high=40.0, default=22.0)
    shoulder_mm: float = quantity(
        "height of the shoulders", unit="mm", low=20.0, high=50.0, default=34.0
    )
    shoulder_radius_mm: float = quantity(
        "radius of the shoulders' edges", unit="mm", low=4.5, high=12.0, default=6.0
    )
    fillet_mm: float = quantity(
        "radius between shoulder and crown", unit="mm", low=12.0, high=25.0, default=14.0
    )
    edge_mm: float = quantity(
        "radius of the cast edges at both faces", unit="mm", low=1.0, high=4.2, default=4.0
    )
    draft_deg: float = quantity(
        "draft of the feet's outer sides", unit="°", low=0.5, high=5.0, default=2.0
    )
    rib_mm: float = quantity(
        "height of the rib over the arch", unit="mm", low=4.0, high=9.0, default=5.0
    )
    rib_width_mm: float = quantity(
        "width of the rib's back", unit="mm", low=4.0, high=14.0, default=8.0
    )
    boss_mm: float = quantity(
        "diameter of the bolt bosses at the top", unit="mm", low=22.0, high=30.0, default=27.0
    )
    boss_height_mm: float = quantity(
        "height of the bosses", unit="mm", low=11.0, high=25.0, default=12.0
    )
    bolt_spacing_mm: float = quantity(
        "distance of the bolts along x", unit="mm", low=100.0, high=210.0, default=132.0
    )
    bolt_mm: float = quantity(
        "diameter of the bolt holes", unit="mm", low=8.0, high=18.0, default=13.5
    )
    chamfer_mm: float = quantity(
        "chamfers of bore and holes", unit="mm", low=0.3, high=2.0, default=1.0
    )


PARAMETERS = BearingCap


def make(cap: BearingCap, facet_um: float | None) -> Part:
    """Tessellate the cap with facets within `facet_um` of the true surface.

    Regions: ``outer`` (cast skin), ``crown`` (cast skin over the bore), ``boss`` (bosses and
    their tops), ``side`` (both flat faces), ``bore``, ``hole``, ``joint``.
    """
    _check(cap)
    facet_mm = (DEFAULT_FACET_UM if facet_um is None else facet_um) / 1000.0
    bolt = cap.bolt_spacing_mm / 2.0
    cast = {
        "body": [cap_shape.blank(cap, facet_mm)],
        "boss": [cap_shape.boss(cap, facet_mm, x) for x in (-bolt, bolt)],
    }
    cut = {
        "joint": [cap_shape.joint(cap)],
        "bore": [cap_shape.bore(cap, facet_mm), cap_shape.tang_slot(cap)],
        "hole": [cap_shape.bolt_hole(cap, facet_mm, x) for x in (-bolt, bolt)],
    }
    # Numbered by manifold3d, so that each face of the result knows which of them it is from.
    cast, cut = (
        {name: [piece.as_original() for piece in group] for name, group in pieces.items()}
        for pieces in (cast, cut)
    )
    operand = manifold3d.OpType
    solid = manifold3d.Manifold.batch_boolean(cast["body"] + cast["boss"], operand.Add)
    solid = manifold3d.Manifold.batch_boolean([solid, *sum(cut.values(), [])], operand.Subtract)
    if solid.status() != manifold3d.Error.NoError or len(solid.decompose()) != 1:
        raise PartError("builtin:bearing_cap", "the parameters give no single solid", "vary them")
    mesh = solid.to_mesh64()
    vertices = np.array(mesh.vert_properties[:, :3], dtype=np.float64)
    faces = np.array(mesh.tri_verts, dtype=np.int32)
    owner = {
        piece.original_id(): name for name, group in (cast | cut).items() for piece in group
    }
    bounds = np.array(mesh.run_index, dtype=np.int64) // 3
    runs = bounds[1:] - bounds[:-1]
    names = np.repeat([owner[int(number)] for number in mesh.run_original_id], runs)
    middle = vertices[faces].mean(axis=1)
    flat = np.abs(np.abs(middle[:, 1]) - cap.length_mm / 2.0) < 1e-9
    body, crown = names == "body", cap.bore_mm / 2.0 + cap.wall_mm
    over = body & ~flat & (np.abs(middle[:, 0]) < 0.7 * crown) & (middle[:, 2] > 0.5 * crown)
    return Part(
        name="bearing_cap",
        vertices_mm=vertices,
        faces=faces,
        regions={
            "outer": (body & ~flat) | (names == "boss"),
            "crown": over,
            "boss": names == "boss",
            "side": body & flat,
            "bore": names == "bore",
            "hole": names == "hole",
            "joint": names == "joint",
        },
        source="builtin:bearing_cap",
    )


def _check(cap: BearingCap) -> None:
    """Refuse sizes that don't fit each other."""
    crown = cap.bore_mm / 2.0 + cap.wall_mm
    foot = np.sqrt(max((crown + cap.fillet_mm) ** 2 - (cap.shoulder_mm + cap.fillet_mm) ** 2, 0.0))
    reach = cap.boss_mm / 2.0 + cap_shape.BOSS_FOOT_MM + 1.0
    bolt = cap.bolt_spacing_mm / 2.0
    side = cap.width_mm / 2.0 - cap.shoulder_mm * np.tan(np.radians(cap.draft_deg))
    problems = (
        (cap.shoulder_mm > crown - 10.0, "shoulder_mm is too high for the crown"),
        (foot + 2.0 > side - cap.shoulder_radius_mm, "width_mm leaves no shoulder"),
        (bolt + reach > side - cap.shoulder_radius_mm + 0.5, "bolt_spacing_mm is too wide"),
        (bolt - cap.bolt_mm / 2.0 < cap.bore_mm / 2.0 + 4.0, "bolt_spacing_mm is too narrow"),
        (2.0 * reach > cap.length_mm - 2.0 * cap.edge_mm, "boss_mm is too wide for length_mm"),
        (cap.bolt_mm + 2.0 * cap.chamfer_mm > cap.boss_mm - 4.0, "bolt_mm is too wide for boss_mm"),
        (cap.fillet_mm < cap.rib_mm + 3.0, "fillet_mm is too small for rib_mm"),
        (cap.rib_width_mm + 10.0 > cap.length_mm - 2.0 * cap.edge_mm, "rib_width_mm is too wide"),
    )
    for wrong, what in problems:
        if wrong:
            raise PartError("builtin:bearing_cap", what, "change one of the two")
