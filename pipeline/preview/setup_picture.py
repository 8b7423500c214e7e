"""A picture of a recipe before anything is generated: part, flaws, sensor fan and path."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from files.whole_file import whole
from pipeline.preview.annotation import DARK, colour_of, scale_bar, spread, triad
from pipeline.preview.camera import Camera, render
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]

STEEL = np.array([0.70, 0.73, 0.77])
LASER = "#E6007A"
DPI = 120
CLOSE_UPS = 3


def draw_setup(
    path: str | Path,
    *,
    vertices_mm: Floats,
    faces: NDArray[np.integer[Any]],
    instance: NDArray[np.integer[Any]],
    poses: Floats,
    datasheet: Datasheet,
    title: str,
    kinds: Mapping[int, str] | None = None,
) -> Path:
    """Draw a specimen under the sensor and close-ups of its flaws.

    Parameters
    ----------
    path : path
        PNG to write.
    vertices_mm : (V, 3)
        The flawed solid, part frame, mm.
    faces : (F, 3)
        Its triangles.
    instance : (F,)
        Number of the flaw that made each triangle, 0 = none.
    poses : (n, 4, 4)
        The scan's poses, sensor -> part.
    datasheet : Datasheet
        The sensor.
    title : str
        Headline of the picture.
    kinds : mapping, optional
        Kind of each flaw by its number; chooses its colour and name.

    Returns
    -------
    Path
        The picture.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    scene = Scene(vertices_mm, faces)
    instance = np.asarray(instance)
    numbers = [int(number) for number in np.unique(instance) if number > 0]
    named = {number: (kinds or {}).get(number, "flaw") for number in numbers}
    shown = _worth_showing(scene, instance, named)
    figure = Figure(figsize=(14.0, 8.4), dpi=DPI, facecolor="white")
    FigureCanvasAgg(figure)
    wide = 0.985 if not shown else 0.735
    overview = figure.add_axes((0.015, 0.075, wide - 0.015, 0.815))
    figure.text(0.02, 0.965, title, fontsize=15, weight="bold", va="top")
    figure.text(0.02, 0.925, _facts(datasheet, poses, named), fontsize=9.5, va="top", color="#444")
    _overview(overview, scene, instance, named, poses, datasheet)
    for at, number in enumerate(shown):
        height = 0.815 / CLOSE_UPS
        bottom = 0.89 - (at + 1) * height
        axes = figure.add_axes((0.755, bottom + 0.005, 0.23, height - 0.045))
        _close_up(axes, scene, instance, number, named[number])
    with whole(path) as aside:
        figure.savefig(aside, dpi=DPI)
    return Path(path)


def _facts(datasheet: Datasheet, poses: Floats, named: Mapping[int, str]) -> str:
    steps = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    way = f"{len(poses)} profiles over {steps.sum():.4g} mm"
    pitch = f"one every {np.median(steps):.3g} mm" if len(steps) else "one profile"
    flaws = f"{len(named)} flaw" + ("" if len(named) == 1 else "s")
    return (
        f"{datasheet.name}: line {datasheet.x_fov_mm:g} mm at {datasheet.working_distance_mm:g} mm,"
        f" range ±{datasheet.z_range_mm / 2:g} mm   ·   {way}, {pitch}   ·   {flaws}"
    )


def _overview(
    axes: "Axes",
    scene: Scene,
    instance: NDArray[Any],
    named: Mapping[int, str],
    poses: Floats,
    datasheet: Datasheet,
) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    x, y, z = poses[len(poses) // 2, :3, :3].T
    shown = np.unique(np.linspace(0, len(poses) - 1, 3).round().astype(int))
    fans = [_fan_mm(datasheet, poses[at]) for at in shown]
    everything = np.concatenate([scene.vertices_mm, *fans])
    # a high sensor over a small part is seen from higher up, so that the part stays large
    size = np.ptp(everything @ np.stack([x, y, z], axis=1), axis=0)
    high = np.radians(np.clip(33.0 + 20.0 * (size[2] / max(size[0], size[1]) - 0.7), 33.0, 54.0))
    look = z * np.sin(high) + np.cos(high) * (0.62 * y - 0.78 * x)
    camera = Camera.around(everything, look=look, up=-z, pixels=_pixels(axes), foot=0.06)
    picture = render(scene, camera, _colours(instance, named), groups=instance)
    axes.imshow(picture, extent=camera.extent_mm, zorder=1)
    for at, fan in zip(shown, fans, strict=True):
        middle = at == shown[len(shown) // 2]
        flat = camera.plane_mm(fan)
        if middle:
            axes.fill(*flat[1:].T, color=LASER, alpha=0.13, lw=0, zorder=3)
        border, faint = flat[[1, 2, 3, 4, 1]], 0.8 if middle else 0.35
        axes.plot(*border.T, color=LASER, lw=0.9, alpha=faint, zorder=4)
        for corner in (1, 2):
            ray = flat[[0, corner]]
            axes.plot(*ray.T, color=LASER, lw=0.7, ls=(0, (4, 3)), alpha=0.6, zorder=4)
        axes.plot(*flat[0], "s", ms=7, color=DARK, mec="white", mew=0.8, zorder=8)
    _swath(axes, camera, scene, poses, datasheet)
    _path(axes, camera, poses)
    _markers(axes, camera, scene, instance, named)
    handles = [
        Line2D([], [], color=LASER, lw=2.2, label="laser line on the part"),
        Patch(facecolor=LASER, alpha=0.22, label="measuring range"),
        Line2D([], [], color=DARK, lw=1.6, marker="s", ms=6, label="path of the sensor"),
        Line2D([], [], color=LASER, lw=1.1, ls=(0, (5, 2)), label="what is scanned"),
    ]
    for kind in dict.fromkeys(named.values()):
        count = sum(other == kind for other in named.values())
        handles.append(Patch(facecolor=colour_of(kind), label=f"{kind} ({count})"))
    axes.legend(
        handles=handles,
        loc="upper center",
        bbox_to_anchor=(0.5, -0.005),
        ncols=min(len(handles), 5),
        frameon=False,
        fontsize=9,
        columnspacing=1.4,
    )
    scale_bar(axes, camera)
    triad(axes, camera)
    _bare(axes, camera)


def _swath(
    axes: "Axes", camera: Camera, scene: Scene, poses: Floats, datasheet: Datasheet
) -> None:
    """Draw the laser's lines on the part, and the border of what they sweep over."""
    laser = Laser.from_datasheet(datasheet, points=400)
    some = np.unique(np.linspace(0, len(poses) - 1, 61).round().astype(int))
    depth = scene.cast(laser, poses[some]).depth_mm
    outside = ~((depth >= datasheet.depth_min_mm) & (depth <= datasheet.depth_max_mm))
    points = laser.points_mm(np.where(outside, np.nan, depth))
    points = points @ poses[some, :3, :3].transpose(0, 2, 1) + poses[some, None, :3, 3]
    valid = np.isfinite(points[..., 0])
    for row in sorted({0, len(some) // 2, len(some) - 1}):
        line = points[row]
        jump = np.abs(np.diff(depth[row], prepend=depth[row, 0])) > datasheet.z_range_mm / 50
        middle = row == len(some) // 2
        broken = np.where(jump[:, None], np.nan, line)
        _line(axes, camera, scene, broken, lw=2.3 if middle else 1.1, dashed=not middle)
    for first in (True, False):
        ends = [
            np.flatnonzero(ok)[0 if first else -1] if ok.any() else -1 for ok in valid
        ]
        edge = np.array(
            [points[k, end] if end >= 0 else np.full(3, np.nan) for k, end in enumerate(ends)]
        )
        _line(axes, camera, scene, edge, lw=1.1, dashed=True)


def _line(
    axes: "Axes", camera: Camera, scene: Scene, points_mm: Floats, *, lw: float, dashed: bool
) -> None:
    """Draw a line on the part, faint where the part hides it from the viewer."""
    here = np.isfinite(points_mm).all(axis=1)
    hidden = np.zeros(len(points_mm), dtype=bool)
    if here.any():
        start = points_mm[here] + camera.frame[2] * 1e-3
        hidden[here] = scene.blocked(start, start + camera.frame[2] * 1e5)
    flat = camera.plane_mm(points_mm)
    style: Any = (0, (5, 2)) if dashed else "-"
    for part, alpha in ((~hidden, 1.0), (hidden, 0.22)):
        kept = np.where(part[:, None], flat, np.nan)
        axes.plot(*kept.T, color=LASER, lw=lw, ls=style, alpha=alpha, zorder=5)


def _path(axes: "Axes", camera: Camera, poses: Floats) -> None:
    flat = camera.plane_mm(poses[:, :3, 3])
    axes.plot(*flat.T, color=DARK, lw=1.6, zorder=7)
    way = np.linalg.norm(np.diff(flat, axis=0), axis=1).cumsum()
    if len(way) and way[-1] > 0:
        at = int(np.searchsorted(way, 0.72 * way[-1]))
        step = flat[at + 1] - flat[at]
        axes.annotate(
            "",
            xy=tuple(flat[at + 1] + step / np.linalg.norm(step) * 1e-3 * way[-1]),
            xytext=tuple(flat[at]),
            arrowprops={"arrowstyle": "-|>", "color": DARK, "lw": 0, "mutation_scale": 22},
            zorder=8,
        )


def _markers(
    axes: "Axes", camera: Camera, scene: Scene, instance: NDArray[Any], named: Mapping[int, str]
) -> None:
    """Ring and number each flaw; numbers move apart where flaws are close."""
    if not named:
        return
    centres = np.array([_centre_mm(scene, instance, number) for number in named])
    at = camera.plane_mm(centres)
    above = np.array([_above_mm(scene, instance, number) for number in named])
    hidden = scene.blocked(above, above + camera.frame[2] * 1e5)
    pixel = (camera.window_mm[1] - camera.window_mm[0]) / camera.pixels[0]
    labels = spread(at + pixel * np.array([26.0, 24.0]), at, 30.0 * pixel)
    for flaw, (number, kind) in enumerate(named.items()):
        colour = colour_of(kind)
        axes.plot(
            *at[flaw], "o", ms=11, mfc="none", mec=colour, mew=1.6,
            alpha=0.45 if hidden[flaw] else 1.0, zorder=9,
        )  # fmt: skip
        axes.plot(*np.stack([at[flaw], labels[flaw]]).T, color=colour, lw=0.8, zorder=9)
        axes.text(
            float(labels[flaw, 0]), float(labels[flaw, 1]), str(number),
            ha="center", va="center", fontsize=9, color="white", weight="bold", zorder=10,
            bbox={"boxstyle": "circle,pad=0.22", "fc": colour, "ec": "white", "lw": 0.8},
        )  # fmt: skip


def _close_up(
    axes: "Axes", scene: Scene, instance: NDArray[Any], number: int, kind: str
) -> None:
    own = instance == number
    corners = scene.vertices_mm[scene.faces[own]].reshape(-1, 3)
    normal = _outward(scene, instance, number)
    spread_mm, axis = _size(corners, normal)
    across = np.cross(normal, axis)
    look = -normal * np.cos(np.radians(38)) + across * np.sin(np.radians(38))
    reach = max(0.75 * spread_mm[0], 0.9 * spread_mm[1], 1e-3)
    centre = corners.mean(axis=0)
    cross = np.stack([axis, -axis, across, -across])
    around = centre + reach * cross
    camera = Camera.around(around, look=look, up=normal, pixels=_pixels(axes, 1.6), margin=0.0)
    camera = Camera(
        frame=camera.frame,
        window_mm=camera.window_mm,
        far_mm=float((scene.vertices_mm @ camera.frame[2]).max() + 1.0),
        pixels=camera.pixels,
    )
    near = float(centre @ camera.frame[2]) + 4 * reach
    above = _above_mm(scene, instance, number)[None]
    if not scene.blocked(above, above + camera.frame[2] * 4 * reach).any():
        # look from close by, so that other parts of the part don't stand in the way
        camera = Camera(
            frame=camera.frame, window_mm=camera.window_mm, far_mm=near, pixels=camera.pixels
        )
    tinted = _colours(own.astype(int), {1: kind}, tint=0.5)
    picture = render(scene, camera, tinted, groups=instance, relief=True)
    axes.imshow(picture, extent=camera.extent_mm)
    size = f"{spread_mm[0]:.3g} × {spread_mm[1]:.3g} mm"
    axes.set_title(f"{number}  {kind}, {size}", fontsize=10, loc="left", color=colour_of(kind))
    scale_bar(axes, camera)
    _bare(axes, camera, frame=True)


def _size(corners_mm: Floats, normal: Floats) -> tuple[tuple[float, float], Floats]:
    """Length and width in the tangent plane, mm, and the direction of the length."""
    flat = corners_mm - corners_mm.mean(axis=0)
    flat = flat - np.outer(flat @ normal, normal)
    axis = np.linalg.svd(flat, full_matrices=False)[2][0]
    across = np.cross(normal, axis)
    return (float(np.ptp(flat @ axis)), float(np.ptp(flat @ across))), axis


def _outward(scene: Scene, instance: NDArray[Any], number: int) -> Floats:
    """Direction in which a flaw's faces look on the whole."""
    corner = scene.vertices_mm[scene.faces[instance == number]]
    total = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]).sum(axis=0)
    length = np.linalg.norm(total)
    return np.asarray(total / length if length > 0 else np.array([0.0, 0.0, 1.0]))


def _centre_mm(scene: Scene, instance: NDArray[Any], number: int) -> Floats:
    return np.asarray(scene.vertices_mm[scene.faces[instance == number]].mean(axis=(0, 1)))


def _above_mm(scene: Scene, instance: NDArray[Any], number: int) -> Floats:
    """Return a point just over a flaw, outside what it hollows out."""
    corners = scene.vertices_mm[scene.faces[instance == number]].reshape(-1, 3)
    normal = _outward(scene, instance, number)
    centre = corners.mean(axis=0)
    rise = float(((corners - centre) @ normal).max())
    return np.asarray(centre + (rise + 0.05) * normal)


def _worth_showing(
    scene: Scene, instance: NDArray[Any], named: Mapping[int, str]
) -> list[int]:
    """Up to three flaws for close-ups: of different kinds first, large ones first."""
    corner = scene.vertices_mm[scene.faces]
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    area = np.bincount(instance, weights=np.linalg.norm(cross, axis=1))
    by_area = sorted(named, key=lambda number: -area[number])
    first_of_kind = [
        number
        for at, number in enumerate(by_area)
        if named[number] not in {named[other] for other in by_area[:at]}
    ]
    rest = [number for number in by_area if number not in first_of_kind]
    return sorted((first_of_kind + rest)[:CLOSE_UPS])


def _fan_mm(datasheet: Datasheet, pose: Floats) -> Floats:
    """Emitter, then the corners of the measuring range (near left, near right, far ...), part."""
    laser = Laser.from_datasheet(datasheet, points=2)
    near = laser.points_mm(np.full(2, datasheet.depth_min_mm))
    far = laser.points_mm(np.full(2, datasheet.depth_max_mm))
    corners = np.stack([np.zeros(3), near[0], near[1], far[1], far[0]])
    return np.asarray(corners @ pose[:3, :3].T + pose[:3, 3])


def _colours(instance: NDArray[Any], named: Mapping[int, str], *, tint: float = 1.0) -> Floats:
    from matplotlib.colors import to_rgb

    palette = np.tile(STEEL, (int(instance.max(initial=0)) + 1, 1))
    for number, kind in named.items():
        palette[number] = (1 - tint) * STEEL + tint * np.array(to_rgb(colour_of(kind)))
    return np.asarray(palette[instance])


def _pixels(axes: "Axes", finer: float = 1.25) -> tuple[int, int]:
    box = axes.get_window_extent()
    return round(box.width * finer), round(box.height * finer)


def _bare(axes: "Axes", camera: Camera, *, frame: bool = False) -> None:
    left, right, bottom, top = camera.extent_mm
    axes.set_xlim(left, right)
    axes.set_ylim(bottom, top)
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_visible(frame)
        spine.set_color("#B8BEC6")
