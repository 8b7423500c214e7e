"""The cast blank, the bosses and the cutters of a main-bearing cap, as manifold3d solids."""

from __future__ import annotations

from typing import TYPE_CHECKING

import manifold3d
import numpy as np
from numpy.typing import NDArray

from pipeline.parts.builtin.round_profile import Pen, arc_steps
from pipeline.parts.builtin.sheet import close_tube
from pipeline.parts.mesh.bodies import manifold

if TYPE_CHECKING:
    from pipeline.parts.builtin.bearing_cap import BearingCap

Array = NDArray[np.float64]
BELOW_MM = 12.0  # how far the blank reaches below the joint face before it is machined
RIB_WALL_RAD = np.radians(80.0)
RIB_FOOT_MM, RIB_EDGE_MM = 2.5, 1.5
BOSS_FOOT_MM, BOSS_EDGE_MM = 3.0, 2.0


def blank(cap: BearingCap, facet_mm: float) -> manifold3d.Manifold:
    """Cast body: the arch's outline swept along the bore, parallel curves giving rib and edges.

    Two families of arcs cross (those of the outline and those of the section along the bore), so
    each gets half of `facet_mm`.
    """
    outline, section = arch(cap, 0.5 * facet_mm), along_bore(cap, 0.5 * facet_mm)
    shift = section.points_mm[:, 1]
    plan = outline.points_mm[:, None] + shift[None, :, None] * outline.normals[:, None]
    y = np.broadcast_to(section.points_mm[:, 0], plan.shape[:2])
    vertices, faces = close_tube(np.stack([plan[..., 0], y, plan[..., 1]], axis=-1))
    return manifold(vertices, faces)


def arch(cap: BearingCap, facet_mm: float) -> Pen:
    """Outline of the ribless body in x and z, from the left foot over the arch to the right.

    Its normals point outward; its parallel curve at the rib's height is the rib's back.
    """
    shoulder, fillet, edge = cap.shoulder_mm, cap.fillet_mm, cap.shoulder_radius_mm
    crown = cap.bore_mm / 2.0 + cap.wall_mm
    lean = np.radians(cap.draft_deg)
    # The fillet touches the shoulder's plane and the crown's circle about the bore's axis.
    foot_x = np.sqrt((crown + fillet) ** 2 - (shoulder + fillet) ** 2)
    climb = float(np.arctan2(foot_x, shoulder + fillet))
    side = (shoulder + BELOW_MM - edge * (1.0 - np.sin(lean))) / np.cos(lean)
    # cap.width_mm is the width at the joint face.
    start = -cap.width_mm / 2.0 - BELOW_MM * np.tan(lean)
    flat = -foot_x - (start + side * np.sin(lean) + edge * np.cos(lean))
    pen = Pen(start, -BELOW_MM, np.pi / 2.0 - lean, facet_mm)
    pen.line(side).arc(edge, lean - np.pi / 2.0, edge + cap.rib_mm).line(flat)
    pen.arc(fillet, climb, fillet + cap.edge_mm).arc(crown, -2.0 * climb, crown + cap.rib_mm)
    pen.arc(fillet, climb, fillet + cap.edge_mm).line(flat)
    return pen.arc(edge, lean - np.pi / 2.0, edge + cap.rib_mm).line(side)


def along_bore(cap: BearingCap, facet_mm: float) -> Pen:
    """Height of the cast skin above `arch` along the bore's axis y: edges, rib and its fillets."""
    half, edge, quarter = cap.length_mm / 2.0, cap.edge_mm, np.pi / 2.0
    turn, foot, top = RIB_WALL_RAD, RIB_FOOT_MM, RIB_EDGE_MM
    wall = (cap.rib_mm - (foot + top) * (1.0 - np.cos(turn))) / np.sin(turn)
    aside = cap.rib_width_mm / 2.0 + (foot + top) * np.sin(turn) + wall * np.cos(turn)
    pen = Pen(-half, -edge, quarter, facet_mm)
    pen.arc(edge, -quarter).line(half - edge - aside)
    pen.arc(foot, turn).line(wall).arc(top, -turn).line(cap.rib_width_mm)
    pen.arc(top, -turn).line(wall).arc(foot, turn)
    return pen.line(half - edge - aside).arc(edge, -quarter)


def boss(cap: BearingCap, facet_mm: float, x_mm: float) -> manifold3d.Manifold:
    """Bolt boss: drafted cylinder with a rounded edge and a fillet that runs into the shoulder.

    The fillet is sunk by a twentieth of its radius, so that it meets the shoulder at an angle.
    """
    lean, foot, edge = np.radians(3.0), BOSS_FOOT_MM, BOSS_EDGE_MM
    radius, top = cap.boss_mm / 2.0, cap.shoulder_mm + cap.boss_height_mm
    base = cap.shoulder_mm - 0.05 * foot
    wall = top - base - (foot + edge) * (1.0 - np.sin(lean))
    pen = Pen(0.0, top, 0.0, 0.5 * facet_mm)
    pen.line(radius - edge * np.cos(lean)).arc(edge, lean - np.pi / 2.0)
    pen.line(wall / np.cos(lean)).arc(foot, np.pi / 2.0 - lean)
    points = pen.points_mm
    low = base - 4.0
    outline = np.concatenate([points, [[points[-1, 0], low], [0.0, low]]])
    return lathe(outline, 0.5 * facet_mm, 0.0).translate((x_mm, 0.0, 0.0))


def bore(cap: BearingCap, facet_mm: float) -> manifold3d.Manifold:
    """Cutter of the bore with its chamfered ends, about the y axis."""
    radius, half, chamfer = cap.bore_mm / 2.0, cap.length_mm / 2.0, cap.chamfer_mm
    wide = radius + chamfer + 2.0
    outline = np.array(
        [
            (0.0, -half - 2.0),
            (wide, -half - 2.0),
            (radius, -half + chamfer),
            (radius, half - chamfer),
            (wide, half + 2.0),
            (0.0, half + 2.0),
        ]
    )
    # Half a step of phase: no vertex of the bore lies in the joint face.
    turned = lathe(outline, facet_mm, 0.5)
    return turned.transform(
        np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0]])
    )


def bolt_hole(cap: BearingCap, facet_mm: float, x_mm: float) -> manifold3d.Manifold:
    """Cutter of a bolt hole, chamfered at the boss and at the joint face."""
    radius, chamfer = cap.bolt_mm / 2.0, cap.chamfer_mm
    top = cap.shoulder_mm + cap.boss_height_mm
    wide = radius + chamfer + 2.0
    outline = np.array(
        [
            (0.0, -2.0),
            (wide, -2.0),
            (radius, chamfer),
            (radius, top - chamfer),
            (wide, top + 2.0),
            (0.0, top + 2.0),
        ]
    )
    return lathe(outline, facet_mm, 0.5).translate((x_mm, 0.0, 0.0))


def joint(cap: BearingCap) -> manifold3d.Manifold:
    """Cutter of everything below the joint face z = 0."""
    size = np.array([2.0 * cap.width_mm, 2.0 * cap.length_mm, 2.0 * BELOW_MM + cap.width_mm])
    return manifold3d.Manifold.cube(tuple(size)).translate(tuple(-size * (0.5, 0.5, 1.0)))


def tang_slot(cap: BearingCap) -> manifold3d.Manifold:
    """Cutter of the slot in which the bearing shell's tang sits, at the joint face."""
    radius = cap.bore_mm / 2.0
    size = (4.0, 0.14 * cap.length_mm, 10.0)
    slot = manifold3d.Manifold.cube(size, True)
    return slot.translate((radius - 0.5, 0.21 * cap.length_mm, 0.0))


def lathe(outline: Array, facet_mm: float, phase: float) -> manifold3d.Manifold:
    """Solid of revolution about z of an (r, z) outline from axis to axis, z falling or rising.

    Its rings have their vertices on the true circles; `phase` turns them, in steps.
    """
    count = max(8, arc_steps(float(outline[:, 0].max()), 2.0 * np.pi, facet_mm))
    angle = 2.0 * np.pi * (np.arange(count) + phase) / count
    rings = outline[1:-1]
    points = np.stack(
        [
            rings[:, 0] * np.cos(angle)[:, None],
            rings[:, 0] * np.sin(angle)[:, None],
            np.broadcast_to(rings[:, 1], (count, len(rings))),
        ],
        axis=-1,
    )
    vertices, faces = close_tube(points, ends=outline[[0, -1], 1])
    return manifold(vertices, faces)
