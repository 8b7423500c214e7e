"""The instrument as a whole: scan a part, find rows, rectify, deliver."""

from dataclasses import dataclass, field, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from challenge.instrument.instrument import Solid
from challenge.instrument.rays import Tree, nearest, plant
from challenge.second.camera import FINDERS, Camera, expose, taps
from challenge.second.facets import Facets
from challenge.second.firmware import Firmware
from challenge.second.robot import Robot, Warmth
from challenge.second.slit import Slit

Floats = NDArray[np.float64]
CELLS = 10
"""Lit cells across one pitch; a cell scatters with a speckle of its own."""
HEIGHTS, FRAMES = 41, 8
"""Plates that a calibration looks at, and profiles of each."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Travel:
    """A commanded straight scan, horizontal under the upright camera.

    Attributes
    ----------
    start : (4, 4) pose of the first profile, sensor -> part
    profiles, pitch_mm, rate_hz, start_s : as commanded
    """

    start: Floats
    profiles: int
    pitch_mm: float
    rate_hz: float
    start_s: float

    @property
    def travel_mm(self) -> Floats:
        """Commanded way of each profile."""
        return np.arange(self.profiles, dtype=np.float64) * self.pitch_mm

    @property
    def time_s(self) -> Floats:
        """Time of each profile since the first."""
        return np.arange(self.profiles, dtype=np.float64) / self.rate_hz

    def poses(self, way: Floats) -> Floats:
        """Commanded poses (n, 4, 4) along a direction in the sensor's frame."""
        out = np.repeat(self.start[None], self.profiles, axis=0)
        out[:, :3, 3] += self.travel_mm[:, None] * (self.start[:3, :3] @ way)
        return np.asarray(out)


@njit(cache=True)
def _heights(
    tree: Tree, x: Floats, y: Floats, depth: Floats, which: NDArray[np.int64]
) -> None:
    """First hits of rays along +z from (x, y, 0) on a grid."""
    for i in range(y.size):
        for j in range(x.size):
            far, triangle = nearest(tree, (x[j], y[i], 0.0), (0.0, 0.0, 1.0), 0.0, 1e9, False)
            if triangle >= 0:
                depth[i, j], which[i, j] = far, triangle


@dataclass(frozen=True, kw_only=True, slots=True)
class Device:
    """One instrument.

    Attributes
    ----------
    distance_mm, z_range_mm : of the middle of the range, and its length
    exposure_s : during which the travel goes on
    ambient_e : stray light in a pixel, electrons, and its flicker from profile to profile
    calibration : polynomial of depth over column and row; None before `calibrated`
    """

    slit: Slit
    camera: Camera
    finder: str = "gaussian"
    threshold: float = 0.03
    firmware: Firmware = field(default_factory=Firmware)
    robot: Robot = field(default_factory=Robot)
    warmth: Warmth = field(default_factory=Warmth)
    distance_mm: float = 120.0
    z_range_mm: float = 12.0
    exposure_s: float = 2e-5
    ambient_e: float = 40.0
    flicker: float = 0.0
    calibration: Floats | None = None

    @property
    def way(self) -> Floats:
        """Travel in the sensor's frame: across the camera's axis."""
        theta = self.camera.theta_rad
        return np.array([0.0, np.cos(theta), self.camera.side * np.sin(theta)])

    @property
    def to_camera(self) -> Floats:
        """Direction from the part to the camera, sensor frame."""
        theta = self.camera.theta_rad
        return np.array([0.0, self.camera.side * np.sin(theta), -np.cos(theta)])

    def rows(
        self, solid: Solid, facets: Facets, travel: Travel, rng: np.random.Generator, *,
        specimen: int, misplaced: Floats | None = None,
    ) -> tuple[Floats, Floats]:  # fmt: skip
        """Rows (n, columns) in which the line is found, and brightness."""
        camera = self.camera
        start = travel.start if misplaced is None else misplaced @ travel.start
        inverse = np.linalg.inv(start)
        tree = plant(solid.vertices_mm @ inverse[:3, :3].T + inverse[:3, 3], solid.faces)
        shift, turn = self.robot.errors(travel.travel_mm, travel.time_s, rng)
        x = camera.columns_mm
        step = travel.pitch_mm * np.cos(camera.theta_rad) / CELLS
        reach = self.slit.reach_mm
        wide = reach + np.abs(shift[:, 1]).max() + np.abs(turn[:, 2]).max() * np.abs(x).max()
        last = travel.travel_mm[-1] * np.cos(camera.theta_rad)
        # beyond the line's reach lies what may stand in the camera's way
        behind = self.z_range_mm * np.tan(camera.theta_rad)
        y = np.arange(-wide - behind, last + wide + behind + step, step)
        depth, normal, points = self._surface(tree, x, y, start)
        bright = self._brightness(facets, depth, normal, points, y, start)
        bright = bright * facets.speckle(depth.shape, np.random.default_rng([specimen, 2]))
        clock = travel.start_s + travel.time_s
        warm_turn, warm_shift = self.warmth.at(clock)
        ambient = self.ambient_e * (1 + self.flicker * np.sin(2 * np.pi * 100.3 * clock))
        drive = travel.pitch_mm * travel.rate_hz * self.exposure_s
        parts = max(1, int(np.ceil(drive / (0.3 * self.slit.width_mm))))
        within = (np.arange(parts) + 0.5) / parts * drive
        found = np.full((travel.profiles, camera.columns), np.nan)
        peak = np.zeros(found.shape)
        row_taps, column_taps = taps(camera.blur_rows), taps(camera.blur_columns)
        top = float(2**camera.bits - 1)
        for p in range(travel.profiles):
            light, rows = [], []
            for moved in within:
                at = travel.travel_mm[p] + moved
                off = shift[p, 1] + turn[p, 2] * x - turn[p, 0] * self.distance_mm
                middle = at * np.cos(camera.theta_rad) + off
                first, end = np.searchsorted(y, [middle.min() - reach, middle.max() + reach])
                eta = y[first:end, None] - middle
                own = depth[first:end] - camera.side * at * np.sin(camera.theta_rad)
                own = own - shift[p, 2] - turn[p, 1] * x
                z = own - self.distance_mm
                power = self.slit.irradiance(eta) * bright[first:end] * step / parts
                seen = replace(camera, theta_rad=camera.theta_rad + float(warm_turn[p]))
                rows.append(seen.row_of(x, eta + warm_shift[p], z))
                light.append(np.nan_to_num(power / self.slit.width_mm))
            found[p], peak[p] = expose(
                np.concatenate(light), np.nan_to_num(np.concatenate(rows), nan=-1.0), row_taps,
                column_taps, camera.electrons, camera.full_well,
                camera.read_noise_e, float(ambient[p]), top, FINDERS.index(self.finder),
                self.threshold, rng.standard_normal((camera.columns, camera.rows)),
            )  # fmt: skip
        return found, peak

    def _surface(
        self, tree: Tree, x: Floats, y: Floats, start: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """Depth (k, m), normals and points in the part's frame, on the fine grid."""
        depth = np.full((y.size, x.size), np.nan)
        which = np.zeros(depth.shape, np.int64)
        _heights(tree, x, y, depth, which)
        local = np.stack(np.broadcast_arrays(x, y[:, None], depth), -1)
        return depth, tree.normal[which], local @ start[:3, :3].T + start[:3, 3]

    def _brightness(
        self, facets: Facets, depth: Floats, normal: Floats, points: Floats, y: Floats,
        start: Floats,
    ) -> Floats:  # fmt: skip
        """Radiance towards the camera of cells lit by the sheet, 0 where it can't see them."""
        tan, side = np.tan(self.camera.theta_rad), self.camera.side
        across = side * y[:, None] / tan + np.where(np.isfinite(depth), depth, np.inf)
        towards = across[::-1] if side > 0 else across
        nearer = np.minimum.accumulate(towards, axis=0)
        nearer = nearer[::-1] if side > 0 else nearer
        lay = np.array([np.cos(facets.lay_rad), np.sin(facets.lay_rad), 0.0]) @ start[:3, :3]
        lay = lay - (normal @ lay)[..., None] * normal
        lay = lay / np.maximum(np.linalg.norm(lay, axis=-1, keepdims=True), 1e-9)
        bright = facets.towards(normal, lay, np.array([0.0, 0.0, -1.0]), self.to_camera)
        visible = across <= nearer + 1e-9
        return np.where(visible, np.nan_to_num(bright * facets.printed(points)), 0.0)

    def calibrated(
        self, rng: np.random.Generator, *, gauge_stretch: float = 0.0, plate_bow_mm: float = 0.0
    ) -> "Device":
        """Learn depth from plates at stated heights, standing still and cold.

        Parameters
        ----------
        gauge_stretch
            How much larger the blocks under the plate truly are than stated.
        plate_bow_mm
            How much nearer the plate's middle is than its ends.
        """
        camera = self.camera
        cold = replace(self, robot=Robot(), warmth=Warmth(), exposure_s=1e-7, flicker=0.0)
        u, v, z = [], [], []
        reach = 0.5 * self.z_range_mm + 0.4
        for k, height in enumerate(np.linspace(-reach, reach, HEIGHTS)):
            travel = Travel(start=np.eye(4), profiles=FRAMES, pitch_mm=4 * self.slit.width_mm,
                            rate_hz=100.0, start_s=0.0)  # fmt: skip
            plate = _level(self, height * (1 + gauge_stretch), travel, plate_bow_mm)
            row, _ = cold.rows(plate, Facets(), travel, rng, specimen=int(rng.integers(2**31)) + k)
            u.append(2 * camera.columns_mm / camera.x_fov_mm)
            v.append(2 * np.nanmean(row, axis=0) / camera.rows - 1)
            z.append(np.full(camera.columns, height))
        basis = np.polynomial.legendre.legvander2d(np.concatenate(u), np.concatenate(v), [4, 3])
        found = np.linalg.lstsq(basis, np.concatenate(z), rcond=None)[0]
        return replace(self, calibration=found.reshape(5, 4))

    def depths(self, rows: Floats) -> Floats:
        """Turn rows (n, columns) into depths by the instrument's own calibration, mm."""
        if self.calibration is None:
            raise ValueError("the instrument has not been calibrated")
        u = np.broadcast_to(2 * self.camera.columns_mm / self.camera.x_fov_mm, rows.shape)
        v = 2 * rows / self.camera.rows - 1
        z = np.polynomial.legendre.legval2d(u, np.nan_to_num(v), self.calibration)
        return np.where(np.isfinite(rows), self.distance_mm + z, np.nan)

    def scan(
        self, solid: Solid, facets: Facets, travel: Travel, rng: np.random.Generator, *,
        specimen: int, misplaced: Floats | None = None,
    ) -> tuple[Floats, Floats]:  # fmt: skip
        """Deliver depth (n, m) on even x, and brightness."""
        rows, peak = self.rows(solid, facets, travel, rng, specimen=specimen, misplaced=misplaced)
        depth = self.depths(rows)
        half = self.z_range_mm / 2
        depth = np.where(np.abs(depth - self.distance_mm) <= half, depth, np.nan)
        depth, peak = (rectified(self.camera, grid) for grid in (depth, peak))
        delivered = self.firmware.deliver(depth, self.distance_mm - half - 1.0)
        return delivered, np.where(np.isfinite(delivered), peak, np.nan)


def expected(device: Device, solid: Solid, travel: Travel, misplaced: Floats) -> Floats:
    """Depth (n, m) of the mesh on even x, as a perfect instrument on its path would read it."""
    start = misplaced @ travel.start
    inverse = np.linalg.inv(start)
    tree = plant(solid.vertices_mm @ inverse[:3, :3].T + inverse[:3, 3], solid.faces)
    x, y = device.camera.even_mm, travel.travel_mm * device.way[1]
    depth = np.full((y.size, x.size), np.nan)
    which = np.zeros(depth.shape, np.int64)
    _heights(tree, x, y, depth, which)
    return np.asarray(depth - (travel.travel_mm * device.way[2])[:, None])


def rectified(camera: Camera, values: Floats) -> Floats:
    """Interpolate profiles (n, columns) linearly onto even x; NaN beside a missing reading."""
    at = np.interp(camera.even_mm, camera.columns_mm, np.arange(camera.columns))
    left = np.minimum(at.astype(int), camera.columns - 2)
    part = at - left
    low, high = values[:, left], values[:, left + 1]
    mixed = low * (1 - part) + high * part
    return np.asarray(np.where(part == 0, low, np.where(part == 1, high, mixed)))


def _level(device: Device, height_mm: float, travel: Travel, bow_mm: float = 0.0) -> Solid:
    """Plate that lies along the travel at one height in all profiles, bowed over the line."""
    theta, side = device.camera.theta_rad, device.camera.side
    end = travel.travel_mm[-1] * np.cos(theta) + 40.0
    x = np.linspace(-1.3, 1.3, 53) * device.camera.x_fov_mm / 2
    sag = bow_mm * (1 - (2 * x / device.camera.x_fov_mm) ** 2)
    z = device.distance_mm + height_mm - sag
    near, far = (
        np.stack([x, np.full(x.size, y), z + side * np.tan(theta) * y], 1) for y in (-40.0, end)
    )
    i = np.arange(x.size - 1)
    first = np.stack([i, i + x.size, i + 1], 1)
    second = np.stack([i + 1, i + x.size, i + x.size + 1], 1)
    return Solid(
        vertices_mm=np.concatenate([near, far]), faces=np.concatenate([first, second])
    )
