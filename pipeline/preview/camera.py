"""An orthographic camera for pictures: shaded meshes by casting rays, point clouds by splatting.

Its image plane is in millimetres, so that a picture's scale is true and lines drawn over it need
no perspective.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from sensors.casting.scene import Scene

Floats = NDArray[np.float64]

CREASE_RAD = np.radians(32.0)  # sharper edges stay sharp in the shading
INK = np.array([0.16, 0.18, 0.22])
LIGHTS = (  # direction towards the light (right, up, back), strength
    (np.array([-0.80, 0.42, 0.42]), 0.78),
    (np.array([0.80, 0.25, 0.40]), 0.22),
    (np.array([0.0, 0.0, 1.0]), 0.18),
)
AMBIENT = 0.20


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Camera:
    """Where the viewer stands, infinitely far away.

    Attributes
    ----------
    frame : (3, 3) float64
        Rows: right, up, and back towards the viewer; part frame, orthonormal.
    window_mm : (4,) float64
        Left, right, bottom, top of the picture in the image plane, mm.
    far_mm : float
        Beyond which distance along `back` from the frame's origin nothing is, mm.
    pixels : tuple of int
        Width and height of the picture.
    """

    frame: Floats
    window_mm: Floats
    far_mm: float
    pixels: tuple[int, int]

    @classmethod
    def around(
        cls,
        points_mm: Floats,
        *,
        look: Floats,
        up: Floats,
        pixels: tuple[int, int],
        margin: float = 0.04,
        foot: float = 0.0,
    ) -> Self:
        """Look along `look` so that all of `points_mm` (k, 3), part frame, is in the picture.

        `margin` is left free on each side, `foot` (shares of the height) below as well.
        """
        back = -np.asarray(look, float) / np.linalg.norm(look)
        right = np.cross(np.asarray(up, float), back)
        right /= np.linalg.norm(right)
        frame = np.stack([right, np.cross(back, right), back])
        plane = np.asarray(points_mm, float) @ frame.T
        low, high = plane.min(axis=0), plane.max(axis=0)
        centre, size = (low + high)[:2] / 2, (high - low)[:2]
        room = np.array([1.0, 1.0 - foot]) * pixels
        pixel_mm = max(float((size / room).max()) * (1 + 2 * margin), 1e-9)
        centre[1] -= foot * pixels[1] * pixel_mm / 2
        half = np.array(pixels) * pixel_mm / 2
        window = np.array(
            [centre[0] - half[0], centre[0] + half[0], centre[1] - half[1], centre[1] + half[1]]
        )
        far = float(high[2] + 0.1 * np.linalg.norm(high - low) + 1.0)
        return cls(frame=frame, window_mm=window, far_mm=far, pixels=pixels)

    def plane_mm(self, points_mm: Floats) -> Floats:
        """Project points (..., 3), part frame, into the image plane (..., 2), mm."""
        return np.asarray((np.asarray(points_mm, float) @ self.frame.T)[..., :2])

    @property
    def extent_mm(self) -> tuple[float, float, float, float]:
        """The picture's edges for matplotlib's imshow."""
        left, right, bottom, top = (float(edge) for edge in self.window_mm)
        return left, right, bottom, top

    def rays(self) -> tuple[Floats, Floats]:
        """Origins and directions (h * w, 3) of the pixels' rays, top row first."""
        width, height = self.pixels
        left, right, bottom, top = self.window_mm
        u = left + (np.arange(width) + 0.5) * (right - left) / width
        v = top - (np.arange(height) + 0.5) * (top - bottom) / height
        grid = np.stack(
            [*np.meshgrid(u, v, indexing="xy"), np.full((height, width), self.far_mm)], axis=-1
        )
        origins = grid.reshape(-1, 3) @ self.frame
        return origins, np.broadcast_to(-self.frame[2], origins.shape)


def render(
    scene: "Scene",
    camera: Camera,
    colours: Floats,
    *,
    groups: NDArray[Any] | None = None,
    relief: bool = False,
) -> Floats:
    """Picture of a mesh: shaded, with dark creases and outlines.

    Parameters
    ----------
    scene : Scene
        What to look at.
    camera : Camera
        From where.
    colours : (F, 3)
        Colour of each triangle, 0 to 1.
    groups : (F,), optional
        Triangles of different groups aren't smoothed into each other.
    relief : bool
        Stretch the contrast of the shading, so that shallow shapes show.

    Returns
    -------
    (h, w, 4) float64
        Red, green, blue, alpha; clear where there is nothing.
    """
    width, height = camera.pixels
    origins, directions = camera.rays()
    distance, triangle = scene.first_hit(origins, directions)
    hit = triangle >= 0
    points = origins[hit] + distance[hit, None] * directions[hit]
    normal = smooth_normals(scene, points, triangle[hit], groups) @ camera.frame.T
    normal *= np.where(normal[:, 2:] < 0, -1.0, 1.0)
    flat = np.zeros((height * width, 4))
    shade = light(normal)
    if relief and hit.any():
        low, middle, high = np.percentile(shade, (2, 50, 98))
        gain = np.clip(0.5 / max(high - low, 1e-9), 1.0, 9.0)
        shade = np.clip(0.85 + gain * (shade - middle), 0.25, 1.2)
    flat[hit, :3] = colours[triangle[hit]] * shade[:, None]
    flat[hit, 3] = 1.0
    shape = (height, width)
    facing = np.zeros((height * width, 3))
    facing[hit] = normal
    ink = _ink(distance.reshape(shape), facing.reshape(*shape, 3), camera)[..., None]
    picture = flat.reshape(*shape, 4)
    picture[..., :3] = picture[..., :3] * (1 - ink) + INK * ink
    picture[..., 3] = np.maximum(picture[..., 3], ink[..., 0])
    return np.clip(picture, 0.0, 1.0)


def light(normal: Floats) -> Floats:
    """Brightness of a matt surface with the normals (k, 3), camera frame."""
    shade = np.full(len(normal), AMBIENT)
    for direction, strength in LIGHTS:
        shade += strength * np.clip(normal @ (direction / np.linalg.norm(direction)), 0.0, None)
    return shade


def smooth_normals(
    scene: "Scene",
    points_mm: Floats,
    triangle: NDArray[np.int32],
    groups: NDArray[Any] | None = None,
) -> Floats:
    """Interpolate normals (k, 3) at points on triangles: smooth over facets, sharp at creases."""
    corner = scene.vertices_mm[scene.faces]
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    shared = scene.faces.astype(np.int64)
    if groups is not None:
        shared = shared * (int(groups.max()) + 1) + groups[:, None]
        shared = np.unique(shared, return_inverse=True)[1].reshape(scene.faces.shape)
    at_vertex = np.zeros((int(shared.max()) + 1, 3))
    for axis in range(3):
        weights = np.repeat(cross[:, axis], 3)
        at_vertex[:, axis] = np.bincount(shared.ravel(), weights=weights)
    at_vertex /= np.maximum(np.linalg.norm(at_vertex, axis=1, keepdims=True), 1e-300)
    flat = scene.normals[triangle]
    at_corner = at_vertex[shared[triangle]]
    # a vertex on a crease says nothing about this side of it
    beside = (at_corner * flat[:, None]).sum(axis=2) < np.cos(CREASE_RAD)
    at_corner = np.where(beside[..., None], flat[:, None], at_corner)
    weight = np.empty((len(triangle), 3))
    a, b, c = (corner[triangle, k] for k in range(3))
    twice_area = np.maximum((cross[triangle] * flat).sum(axis=1), 1e-300)
    weight[:, 0] = (np.cross(c - b, points_mm - b) * flat).sum(axis=1) / twice_area
    weight[:, 1] = (np.cross(a - c, points_mm - c) * flat).sum(axis=1) / twice_area
    weight[:, 2] = 1.0 - weight[:, 0] - weight[:, 1]
    normal = (at_corner * weight[..., None]).sum(axis=1)
    return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300))


def splat(
    points_mm: Floats, colours: Floats, camera: Camera, *, radius_px: int = 1
) -> NDArray[np.float64]:
    """Picture of a point cloud: each point a small square, the nearest one on top.

    Parameters
    ----------
    points_mm : (k, 3)
        Part frame.
    colours : (k, 3)
        0 to 1.
    radius_px : int
        A point covers 2 * radius_px - 1 pixels each way.

    Returns
    -------
    (h, w, 4) float64
        Red, green, blue, alpha.
    """
    width, height = camera.pixels
    left, right, bottom, top = camera.window_mm
    seen = points_mm @ camera.frame.T
    order = np.argsort(seen[:, 2], kind="stable")  # far ones first, near ones overwrite
    column = np.floor((seen[order, 0] - left) / (right - left) * width).astype(np.int64)
    row = np.floor((top - seen[order, 1]) / (top - bottom) * height).astype(np.int64)
    picture = np.zeros((height, width, 4))
    nearest = np.full((height, width), -np.inf)
    reach = range(1 - radius_px, radius_px)
    for dv in reach:
        for du in reach:
            u, v = column + du, row + dv
            inside = (u >= 0) & (u < width) & (v >= 0) & (v < height)
            # numpy keeps the last of repeated places: the nearest of this offset
            u, v, which = u[inside], v[inside], order[inside]
            layer = np.full((height, width), -1, dtype=np.int64)
            layer[v, u] = which
            depth = np.where(layer >= 0, seen[layer, 2], -np.inf)
            better = depth > nearest
            nearest[better] = depth[better]
            picture[better, :3] = colours[layer[better]]
            picture[better, 3] = 1.0
    return picture


def _ink(distance_mm: Floats, normal: Floats, camera: Camera) -> Floats:
    """How dark to draw each pixel's outline: steps in distance, and creases (0 to 1)."""
    pixel_mm = (camera.window_mm[1] - camera.window_mm[0]) / camera.pixels[0]
    ink = np.zeros(distance_mm.shape)
    hit = np.isfinite(distance_mm)
    far = np.where(hit, distance_mm, 1e12)
    for axis in (0, 1):
        front, behind = [slice(None)] * 2, [slice(None)] * 2
        front[axis], behind[axis] = slice(None, -1), slice(1, None)
        one, two = tuple(front), tuple(behind)
        # a slope seen under a grazing angle is no step: allow what the two normals explain
        steep = 1.0 / np.clip(np.minimum(normal[one][..., 2], normal[two][..., 2]), 0.08, 1.0)
        step = np.abs(far[one] - far[two]) > 6.0 * pixel_mm * steep
        turn = 1.0 - (normal[one] * normal[two]).sum(axis=-1)
        both = hit[one] & hit[two]
        edge = np.where(step, 0.85, np.where(both, np.clip((turn - 0.12) * 1.2, 0.0, 0.45), 0.0))
        ink[one] = np.maximum(ink[one], np.where(far[one] <= far[two], edge, edge * 0.3 * both))
        ink[two] = np.maximum(ink[two], np.where(far[two] < far[one], edge, edge * 0.3 * both))
    return ink
