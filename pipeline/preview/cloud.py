"""The readings of a scan as a shaded point cloud, true to scale."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.preview.annotation import colour_of, scale_bar, triad
from pipeline.preview.camera import Camera, light, splat
from sensors.casting.laser import Laser

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]

DEPTH_MAP = "viridis_r"


def draw_cloud(
    axes: "Axes", scan: Mapping[str, Any], kinds: Mapping[int, str], limits: tuple[float, float]
) -> None:
    """Draw the readings as shaded points, seen from the sensor's side at an angle."""
    from matplotlib import colormaps
    from matplotlib.colors import to_rgb

    step = max(1, round(np.sqrt(scan["depth"].size / 1.5e6)))
    thin = np.s_[::step, ::step]
    depth, instance = scan["depth"][thin], scan["instance"][thin]
    laser = Laser(x_mm=scan["ray_x_mm"][::step], slope_x=scan["ray_slope"][::step])
    poses = scan["pose"][::step]
    points = laser.points_part_mm(depth, poses)
    valid = np.isfinite(depth)
    axes.set_title("Point cloud, part frame", loc="left", fontsize=11.5)
    axes.set_axis_off()
    if valid.sum() < 3:
        axes.text(0.5, 0.5, "no valid points", ha="center", transform=axes.transAxes)
        return
    x, y, z = poses[len(poses) // 2, :3, :3].T
    look = z * np.sin(np.radians(36)) + np.cos(np.radians(36)) * (0.80 * y - 0.60 * x)
    box = axes.get_window_extent()
    pixels = (round(box.width * 1.2), round(box.height * 1.2))
    camera = Camera.around(points[valid], look=look, up=-z, pixels=pixels, foot=0.09)
    colours = colormaps[DEPTH_MAP]((depth - limits[0]) / (limits[1] - limits[0]))[..., :3]
    for number in np.unique(instance[instance > 0]):
        colours[instance == number] = to_rgb(colour_of(kinds.get(int(number), "flaw")))
    normal = _normals(laser.points_part_mm(scan["depth_ideal"][thin].astype(float), poses), -z)
    seen = normal[valid] @ camera.frame.T
    brightness = 0.25 + 0.85 * light(seen)
    cloud = points[valid]
    footprint = np.ptp(camera.window_mm[:2]) / pixels[0]
    gaps = np.linalg.norm(np.diff(points, axis=1), axis=2), np.linalg.norm(
        np.diff(points, axis=0), axis=2
    )
    spacing = max(float(np.nanmedian(gap)) for gap in gaps if np.isfinite(gap).any())
    radius = int(np.clip(np.ceil(0.5 * spacing / footprint) + 1, 2, 7))
    picture = splat(
        cloud, np.clip(colours[valid] * brightness[:, None], 0, 1), camera, radius_px=radius
    )
    axes.imshow(picture, extent=camera.extent_mm)
    scale_bar(axes, camera)
    triad(axes, camera)


def _normals(points_mm: Floats, otherwise: Floats) -> Floats:
    """Find the normals of a grid of points (n, m, 3), turned to the side of `otherwise`."""
    if min(points_mm.shape[:2]) < 2:
        return np.broadcast_to(otherwise, points_mm.shape)
    normal = np.cross(np.gradient(points_mm, axis=1), np.gradient(points_mm, axis=0))
    length = np.linalg.norm(normal, axis=2, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        normal = normal / length
    normal = np.where((normal @ otherwise)[..., None] < 0, -normal, normal)
    return np.where(np.isfinite(normal), normal, otherwise)
