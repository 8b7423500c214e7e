"""The instrument as a whole: scan a part, find rows, rectify, deliver."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from challenge.instrument.instrument import Solid
from challenge.instrument.rays import Tree, plant
from challenge.second.bounce import second_light
from challenge.second.camera import FINDERS, Camera, Chip, expose
from challenge.second.exposures import Exposures
from challenge.second.facets import Facets
from challenge.second.firmware import Firmware
from challenge.second.lit import Lit, cast, lit_cells
from challenge.second.robot import Robot, Warmth
from challenge.second.slit import Slit
from challenge.second.window import Air, Window

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


@dataclass(frozen=True, kw_only=True, slots=True)
class Device:
    """One instrument.

    Attributes
    ----------
    distance_mm, z_range_mm : of the middle of the range, and its length
    exposure_s : during which the travel goes on
    window, air, exposures : as they are now; the calibration saw none of their faults
    sparks : share of columns in which a welding spark outshines the line
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
    window: Window = field(default_factory=Window)
    air: Air = field(default_factory=Air)
    exposures: Exposures = field(default_factory=Exposures)
    distance_mm: float = 120.0
    z_range_mm: float = 12.0
    exposure_s: float = 2e-5
    ambient_e: float = 40.0
    flicker: float = 0.0
    sparks: float = 0.0
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
        shift, turn = self.robot.errors(travel.travel_mm, travel.time_s, self.way, rng)
        x = camera.columns_mm
        step = travel.pitch_mm * np.cos(camera.theta_rad) / CELLS
        wide = self._reach_mm + np.abs(shift[:, 1]).max()
        wide += np.abs(turn[:, 2]).max() * np.abs(x).max()
        last = travel.travel_mm[-1] * np.cos(camera.theta_rad)
        # beyond the line's reach lies what may stand in the camera's way
        behind = self.z_range_mm * np.tan(camera.theta_rad)
        y = np.arange(-wide - behind, last + wide + behind + step, step)
        lit = lit_cells(tree, facets, x, y, start, self.to_camera, specimen)
        clock = travel.start_s + travel.time_s
        turned, drifted = self.warmth.at(clock)
        images = self.air.shifts(x, clock, rng) + drifted[:, None]
        found = np.full((travel.profiles, x.size), np.nan)
        bright, factor, before = np.zeros(found.shape), 1.0, np.nan
        for p in range(travel.profiles):
            loose = self._flying(rng)
            if facets.bounces:
                loose = self._bounced(tree, facets, x, travel, p, shift[p], rng)
            shots = []
            for part in (1.0, 1 / self.exposures.ratio)[: 1 + (self.exposures.ratio > 1)]:
                exposed = self.exposure_s * factor * part
                begin = 0.0 if part == 1 else self.exposure_s * factor
                light, rows = self._light(
                    lit, travel, p, (begin, exposed), shift[p], turn[p], float(turned[p]),
                    images[p], step,
                )  # fmt: skip
                noise = rng.standard_normal((x.size, camera.rows))
                shots.append(self._image(light, rows, loose, factor * part, float(clock[p]), noise))
            found[p], bright[p] = shots[0] if len(shots) == 1 else self.exposures.merged(*shots)
            seen = shots[0][1][np.isfinite(shots[0][0])]
            factor = self.exposures.next_factor(factor, before)
            before = float(np.median(seen)) if seen.size else np.nan
        return found, bright

    @property
    def _reach_mm(self) -> float:
        """How far beside its middle the sheet lights anything, its second reflection included."""
        return self.slit.reach_mm + (abs(self.window.ghost_mm) if self.window.ghost > 0 else 0.0)

    def _light(
        self, lit: Lit, travel: Travel, p: int, exposed_s: tuple[float, float], shift: Floats,
        turn: Floats, turned: float, image: Floats, step: float,
    ) -> tuple[Floats, Floats]:  # fmt: skip
        """Light and rows (k, columns) of one exposure: cells under the sheet on its way."""
        camera, x = self.camera, self.camera.columns_mm
        speed = travel.pitch_mm * travel.rate_hz
        drive = speed * exposed_s[1]
        parts = max(1, int(np.ceil(drive / (0.3 * self.slit.width_mm))))
        seen = replace(camera, theta_rad=camera.theta_rad + turned)
        light, rows = [], []
        for moved in speed * exposed_s[0] + (np.arange(parts) + 0.5) / parts * drive:
            at = travel.travel_mm[p] + moved
            off = shift[1] + turn[2] * x - turn[0] * self.distance_mm
            middle = at * np.cos(camera.theta_rad) + off
            first, end = np.searchsorted(
                lit.y_mm, [middle.min() - self._reach_mm, middle.max() + self._reach_mm]
            )
            eta = lit.y_mm[first:end, None] - middle
            sheet = self.slit.irradiance(eta)
            if self.window.ghost > 0:
                beside = self.slit.irradiance(eta - self.window.ghost_mm)
                sheet = sheet + self.window.ghost * beside
            fallen = camera.side * at * np.sin(camera.theta_rad) + shift[2] + turn[1] * x
            for cells in lit.layers:
                z = cells.z_mm[first:end] - fallen - self.distance_mm
                power = sheet * cells.bright[first:end] * step / parts / self.slit.width_mm
                row = seen.row_of(x, eta + cells.along_mm[first:end] + image, z)
                v = (row - camera.rows / 2) * camera.row_pitch_mm
                bent, passed = self.window.seen(x, v)
                rows.append(row + bent)
                light.append(power * passed)
        return np.nan_to_num(np.concatenate(light)), np.nan_to_num(np.concatenate(rows), nan=-1.0)

    def _image(
        self, light: Floats, rows: Floats, loose: Floats, factor: float, clock_s: float,
        normal: Floats,
    ) -> tuple[Floats, Floats]:  # fmt: skip
        """Rows found and brightness of one exposure, `factor` times the nominal one long."""
        camera = self.camera
        ambient = self.ambient_e * (1 + self.flicker * np.sin(2 * np.pi * 100.3 * clock_s))
        top = float(2**camera.bits - 1)
        chip = Chip(
            electrons=camera.electrons * factor, ambient=float(ambient * factor),
            full_well=camera.full_well, read_noise=camera.read_noise_e, top=top,
            kind=FINDERS.index(self.finder), threshold=self.threshold * top,
        )  # fmt: skip
        return expose(light, rows, loose, camera.lens, chip, normal)

    def _flying(self, rng: np.random.Generator) -> Floats:
        """Column, row and power (n, 3) of sparks, each as bright as a full pixel and more."""
        if self.sparks == 0:
            return np.zeros((0, 3))
        camera = self.camera
        column = np.flatnonzero(rng.random(camera.columns_mm.size) < self.sparks)
        row = rng.uniform(2, camera.rows - 3, column.size)
        full = camera.full_well / camera.electrons * 2 * np.pi * camera.blur_rows
        return np.stack([column, row, full * rng.uniform(2, 4, column.size)], -1)

    def _bounced(
        self, tree: Tree, facets: Facets, x: Floats, travel: Travel, p: int, shift: Floats,
        rng: np.random.Generator,
    ) -> Floats:  # fmt: skip
        """Column, row and power (n, 3) of second light in one profile."""
        camera = self.camera
        at = travel.travel_mm[p] * self.way + shift * [0, 1, 1]
        landed = second_light(tree, facets, x, float(at[1]), self.to_camera, rng)
        point = landed.point - at
        row = camera.row_of(point[:, 0], point[:, 1], point[:, 2] - self.distance_mm)
        column = np.interp(point[:, 0], x, np.arange(x.size))
        inside = (point[:, 0] >= x[0]) & (point[:, 0] <= x[-1])
        return np.asarray(np.stack([np.round(column), row, landed.power], -1)[inside])

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
        cold = replace(
            self, robot=Robot(), warmth=Warmth(), exposure_s=1e-7, flicker=0.0, air=Air(),
            window=Window(), exposures=Exposures(), sparks=0.0,
        )
        u, v, z = [], [], []
        reach = 0.5 * self.z_range_mm + 0.4
        for k, height in enumerate(np.linspace(-reach, reach, HEIGHTS)):
            travel = Travel(start=np.eye(4), profiles=FRAMES, pitch_mm=4 * self.slit.width_mm,
                            rate_hz=100.0, start_s=0.0)  # fmt: skip
            plate = _level(self, height * (1 + gauge_stretch), travel, plate_bow_mm)
            row, _ = cold.rows(plate, Facets(), travel, rng, specimen=int(rng.integers(2**31)) + k)
            u.append(2 * camera.columns_mm / camera.x_fov_mm)
            v.append(2 * np.nanmean(row, axis=0) / camera.rows - 1)
            z.append(np.full(camera.columns_mm.size, height))
        basis = np.polynomial.legendre.legvander2d(np.concatenate(u), np.concatenate(v), [4, 3])
        found = np.linalg.lstsq(basis, np.concatenate(z), rcond=None)[0]
        return replace(self, calibration=found.reshape(5, 4))

    def depths(self, rows: Floats) -> Floats:
        """Turn rows (n, columns) into depths by the instrument's own calibration, mm."""
        return self.depths_at(self.camera.columns_mm, rows)

    def depths_at(self, x_mm: Floats, rows: Floats) -> Floats:
        """Turn rows (n, m) into depths at places along the line (m,), mm."""
        if self.calibration is None:
            raise ValueError("the instrument has not been calibrated")
        u = np.broadcast_to(2 * x_mm / self.camera.x_fov_mm, rows.shape)
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
        delivered = self.firmware.deliver(depth, self.distance_mm - half - 1.0, rng)
        return delivered, np.where(np.isfinite(delivered), peak, np.nan)


def expected(device: Device, solid: Solid, travel: Travel, misplaced: Floats) -> Floats:
    """Depth (n, m) of the mesh on even x, as a perfect instrument on its path would read it."""
    start = misplaced @ travel.start
    inverse = np.linalg.inv(start)
    tree = plant(solid.vertices_mm @ inverse[:3, :3].T + inverse[:3, 3], solid.faces)
    depth, _ = cast(tree, device.camera.even_mm, travel.travel_mm * device.way[1])
    return np.asarray(depth - (travel.travel_mm * device.way[2])[:, None])


def rectified(camera: Camera, values: Floats) -> Floats:
    """Interpolate profiles (n, columns) linearly onto even x; NaN beside a missing reading."""
    left, part = camera.between
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
