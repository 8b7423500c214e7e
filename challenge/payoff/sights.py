"""How an instrument sees a part during one scan: where flaws may be cut, and what its rays meet.

A sight's frame lies as the part does under the camera's or the laser's axis: z away from the
instrument, y along the travel. Flaws are cut along its z.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import zoom

from challenge.instrument.camera import Camera
from challenge.instrument.instrument import Path, Solid
from challenge.instrument.rays import Tree, nearest, plant
from challenge.instrument.stripes import first_hits
from challenge.second.device import Device, Travel, expected

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


class Sight(Protocol):
    """One scan of one instrument."""

    @property
    def frame(self) -> Floats:
        """Frame in which flaws are cut -> part, (4, 4)."""

    @property
    def start(self) -> Floats:
        """Sensor's frame of the first profile, as commanded -> part, (4, 4)."""

    @property
    def ends_mm(self) -> tuple[Floats, Floats]:
        """Corners of the field that is seen, in the frame's x and y."""

    @property
    def run(self) -> Floats:
        """Step from a profile to the next, (3,) mm in the part's frame."""

    def seen(self, tree: Tree, x_mm: Floats, y_mm: Floats, z_mm: Floats) -> Bools:
        """Whether places (x, y) of the surface, planted in the frame, are both lit and seen."""

    def depth(self, solid: Solid) -> Floats:
        """Depth that each ray meets, (profiles, columns), NaN for nothing."""

    def places(self, depth_mm: Floats) -> Floats:
        """Where the rays' hits lie in the frame's x and y, (profiles, columns, 2)."""


def moved(solid: Solid, pose: NDArray[np.floating]) -> Floats:
    """Vertices of a solid in another frame."""
    return np.asarray(solid.vertices_mm @ pose[:3, :3].T + pose[:3, 3])


@dataclass(frozen=True, kw_only=True, slots=True)
class UprightLaser:
    """First family: a fan of rays along z, the camera beside it."""

    path: Path
    camera: Camera

    @property
    def frame(self) -> Floats:
        """The sensor's own at the first profile."""
        return self.path.start

    @property
    def start(self) -> Floats:
        """Commanded."""
        return self.path.start

    @property
    def ends_mm(self) -> tuple[Floats, Floats]:
        """Fan at the working distance, a little less, by the travel."""
        camera, path = self.camera, self.path
        half = camera.working_distance_mm * np.tan(camera.fov_rad / 2) - 0.5
        ends = np.sort([0.0, path.direction * path.pitch_mm * (path.profiles - 1)])
        return np.array([-half, ends[0]]), np.array([half, ends[1]])

    @property
    def run(self) -> Floats:
        """Along the sensor's y, or against it."""
        path = self.path
        return np.asarray(path.direction * path.pitch_mm * path.start[:3, 1])

    def seen(self, tree: Tree, x_mm: Floats, y_mm: Floats, z_mm: Floats) -> Bools:
        """Sight lines to the camera, from the rays nearest to a place."""
        _, _, visible = first_hits(tree, y_mm, self.camera)
        shape = np.array(z_mm.shape) / visible.T.shape
        # what is not zoomed from a visible ray counts as hidden
        return np.asarray(~zoom(~visible.T, shape, order=0))

    def depth(self, solid: Solid) -> Floats:
        """Rays from the sensor's origin."""
        return self.hits(solid)[0]

    def hits(self, solid: Solid) -> tuple[Floats, Bools]:
        """Depth by rays alone, and whether the camera sees it; (profiles, columns)."""
        tree = plant(moved(solid, np.linalg.inv(self.path.start)), solid.faces)
        depth, _, visible = first_hits(tree, self._y_mm, self.camera)
        return depth, visible

    def places(self, depth_mm: Floats) -> Floats:
        """Along the fan, and at the profile's place."""
        x = depth_mm * np.tan(self.camera.angles_rad())
        return np.stack([x, np.broadcast_to(self._y_mm[:, None], x.shape)], -1)

    @property
    def _y_mm(self) -> Floats:
        path = self.path
        return path.direction * path.pitch_mm * np.arange(path.profiles, dtype=np.float64)


@dataclass(frozen=True, kw_only=True, slots=True)
class UprightCamera:
    """Second family: a telecentric camera along z, the sheet inclined."""

    travel: Travel
    device: Device

    @property
    def frame(self) -> Floats:
        """Camera's axis along z, the middle of the range of the first profile at x = y = 0."""
        device, start = self.device, self.travel.start
        x = np.array([1.0, 0.0, 0.0])
        turn = start[:3, :3] @ np.stack([x, device.way, -device.to_camera], 1)
        out = np.eye(4)
        out[:3, :3] = turn
        out[:3, 3] = start[:3, 3] + device.distance_mm * (start[:3, 2] - turn[:, 2])
        return out

    @property
    def start(self) -> Floats:
        """Commanded."""
        return self.travel.start

    @property
    def ends_mm(self) -> tuple[Floats, Floats]:
        """Delivered profile, a little less, by the travel."""
        half = self.device.camera.x_fov_mm / 2 - 0.5
        return np.array([-half, 0.0]), np.array([half, float(self.travel.travel_mm[-1])])

    @property
    def run(self) -> Floats:
        """Across the camera's axis."""
        return np.asarray(self.travel.pitch_mm * (self.travel.start[:3, :3] @ self.device.way))

    def seen(self, tree: Tree, x_mm: Floats, y_mm: Floats, z_mm: Floats) -> Bools:
        """Whether the sheet lights a place; the camera sees all that the frame's z meets."""
        laser = self._to_frame[:3, :3] @ np.array([0.0, 0.0, -1.0])
        return _lit(tree, x_mm, y_mm, z_mm, laser)

    def depth(self, solid: Solid) -> Floats:
        """Rays of the sheet at the delivered columns."""
        return expected(self.device, solid, self.travel, np.eye(4))

    def places(self, depth_mm: Floats) -> Floats:
        """Hits of the inclined sheet, seen along the frame's z."""
        way = self.travel.travel_mm[:, None, None] * self.device.way
        x = np.broadcast_to(self.device.camera.even_mm, depth_mm.shape)
        points = np.stack([x, np.zeros_like(x), depth_mm], -1) + way
        turn = self._to_frame
        return np.asarray((points @ turn[:3, :3].T + turn[:3, 3])[..., :2])

    @property
    def _to_frame(self) -> Floats:
        return np.asarray(np.linalg.inv(self.frame) @ self.travel.start)


@njit(cache=True)
def _lit(tree: Tree, x_mm: Floats, y_mm: Floats, z_mm: Floats, laser: Floats) -> Bools:
    """Places from which nothing stands in the way of a direction."""
    out = np.zeros(z_mm.shape, np.bool_)
    for i in range(x_mm.size):
        for j in range(y_mm.size):
            if np.isfinite(z_mm[i, j]):
                _, blocker = nearest(
                    tree, (x_mm[i], y_mm[j], z_mm[i, j]), (laser[0], laser[1], laser[2]),
                    1e-3, 1e9, True,
                )  # fmt: skip
                out[i, j] = blocker < 0
    return out
