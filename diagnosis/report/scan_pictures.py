"""Scans that would decide between causes, as pictures: how the part lies under the sensor."""

from textwrap import fill
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull

from diagnosis.diagnosis import Diagnosis
from diagnosis.evidence.next_scan import Scan
from diagnosis.fields import Field
from diagnosis.report.canvas import AFTER, BEFORE, INK, PALE, figure_of, png

DRAWN = 3
"""Scans that are drawn."""


def scan_pictures(result: Diagnosis) -> bytes | None:
    """Draw the first scans that move part or sensor; None where there is none."""
    scans: list[Scan] = []
    for one in result.next_measurements:
        if _moves(one.scan) and one.scan not in scans:
            scans.append(one.scan)
    scans = scans[:DRAWN]
    if not scans:
        return None
    figure, axes = figure_of(max(10.5 * len(scans) / DRAWN, 5.2), 3.6, len(scans))
    for axis, scan in zip(axes, scans, strict=True):
        _draw(axis, result, scan)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, fontsize=7, frameon=False, loc="outside lower center", ncols=3)
    return png(figure)


def outlines_mm(result: Diagnosis, scan: Scan) -> tuple[Field, Field]:
    """Return the part as it lay and as it would lie, in the sensor's frame at the middle profile.

    Returns
    -------
    before, after : (k, 3) and (k, 3)
        Vertices.
    """
    patches = [p for p in result.fit_patches if p.name == scan.like] or [*result.fit_patches]
    poses = np.concatenate([p.view.poses for p in patches])
    depth = float(np.nanmedian(patches[0].depth_mm))
    middle = poses[len(poses) // 2]
    centre = middle[:3, :3] @ np.array([0.0, 0.0, depth]) + middle[:3, 3]
    vertices = patches[0].view.scene.vertices_mm
    before, after = (
        (vertices - pose[:3, 3]) @ pose[:3, :3]
        for pose in (middle, scan.moved(poses, centre)[len(poses) // 2])
    )
    return before, after


def _moves(scan: Scan) -> bool:
    return any((scan.turn_deg, scan.shift_mm, scan.tilt_deg, scan.range_mm))


def _draw(axis: Any, result: Diagnosis, scan: Scan) -> None:
    """Draw the part from above, or from the side where its tilt or distance changes.

    A corner of the part is marked.
    """
    aside = bool(scan.tilt_deg or scan.range_mm)
    across, down = (1, 2) if aside else (0, 1)
    before, after = outlines_mm(result, scan)
    corner = None  # marked in both, so that a turn by half shows
    for vertices, style in (
        (before, {"fill": False, "ls": "--", "ec": INK, "label": "the part as it lay"}),
        (after, {"fc": PALE, "alpha": 0.7, "ec": AFTER, "label": "the part in the next scan"}),
    ):
        flat = vertices[:, [across, down]]
        hull = ConvexHull(flat).vertices
        if corner is None:
            corner = int(hull[np.argmax(flat[hull].sum(axis=1))])
        axis.fill(*flat[hull].T, **style)
        axis.plot(*flat[corner], "o", ms=5, mec=style["ec"], mfc="w" if "ls" in style else AFTER)
    view = result.fit_patches[0].view
    if aside:
        low, high = axis.get_ylim()
        axis.plot([0.0, 0.0], [low - 0.4 * (high - low), float(np.median(after[:, 2]))],
                  color=BEFORE, lw=1.6, label="laser")  # fmt: skip
        axis.set_xlabel("along the travel, mm", fontsize=8)
        axis.set_ylabel("distance from the sensor, mm", fontsize=8)
    else:
        ends = [float(view.column_x_mm.min()), float(view.column_x_mm.max())]
        axis.plot(ends, [0.0, 0.0], color=BEFORE, lw=1.6, label="laser")
        axis.set_xlabel("along the laser line, mm", fontsize=8)
        axis.set_ylabel("along the travel, mm", fontsize=8)
    axis.set_aspect("equal", adjustable="datalim")
    if aside:
        axis.invert_yaxis()
    axis.set_title(fill(scan.what, 30), fontsize=9)
