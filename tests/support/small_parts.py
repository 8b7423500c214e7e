"""Small closed parts and scans of them, for tests and benchmarks of the diagnosis."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet
from sensors.model import SensorModel, draw_effects, scan_with
from sensors.noise.perlin import PerlinField
from sensors.recording import Recording
from sensors.view.view import View

Floats = NDArray[np.float64]
SPECKLE = PerlinField(amplitude_mm=0.035, cell_x_mm=0.8, cell_y_mm=1.1, octaves=3)
"""About 9 µm of noise, correlated over two or three readings."""
MISPLACED = 5e-4, 0.05
"""How parts lie off by chance, standard deviation about and along each axis, rad and mm."""
BRIGHTNESS_SPECKLE = 0.1
"""Relative scatter of the brightness that a recording of a printed part has."""


def solid(height: Callable[[Floats, Floats], Floats], x_mm: Floats, y_mm: Floats) -> Scene:
    """Build the closed solid under a height field, base at z = -20."""
    grid_x, grid_y = np.meshgrid(x_mm, y_mm, indexing="ij")
    top = np.stack([grid_x, grid_y, height(grid_x, grid_y)], axis=-1)
    base = np.stack([grid_x, grid_y, np.full_like(grid_x, -20.0)], axis=-1)
    n, m = grid_x.shape
    vertices = np.concatenate([top.reshape(-1, 3), base.reshape(-1, 3)])
    index = np.arange(n * m).reshape(n, m)
    a, b, c, d = (
        index[:-1, :-1].ravel(), index[1:, :-1].ravel(),
        index[1:, 1:].ravel(), index[:-1, 1:].ravel(),
    )  # fmt: skip
    up = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    down = up[:, ::-1] + n * m
    loop = np.concatenate([index[:-1, 0], index[-1, :-1], index[:0:-1, -1], index[0, :0:-1]])
    after = np.roll(loop, -1)
    side = np.concatenate(
        [
            np.stack([loop, loop + n * m, after + n * m], 1),
            np.stack([loop, after + n * m, after], 1),
        ]
    )
    return Scene(vertices, np.concatenate([up, down, side]))


def knots(span_mm: float, count: int, breaks: Sequence[float] = ()) -> Floats:
    """Grid lines from -span/2 to span/2; two lines 1 µm apart at each break make a steep wall."""
    lines = np.linspace(-span_mm / 2, span_mm / 2, count)
    lines = lines[[all(abs(v - b) > 0.3 for b in breaks) for v in lines]]
    walls = [b + s for b in breaks for s in (-0.01, 0.01)]
    return np.unique(np.concatenate([lines, walls]))


def domes(x: Floats, y: Floats) -> Floats:
    """Gentle hills on a plane."""
    out = np.zeros_like(x)
    for cx, cy, h, r in ((-12, -8, 5, 9), (11, 9, 6, 11), (14, -14, 3, 7), (-15, 13, 4, 8)):
        d2 = ((x - cx) ** 2 + (y - cy) ** 2) / r**2
        out += h * np.exp(-1.5 * d2)
    return out


def steps(x: Floats, y: Floats) -> Floats:
    """Blocks with steep walls on a plane."""
    out = np.zeros_like(x)
    out[(x > -15) & (x < -3) & (y > -12) & (y < 4)] = 4.0
    out[(x > 5) & (x < 17) & (y > -4) & (y < 14)] = 2.5
    return out


def wedge(x: Floats, y: Floats) -> Floats:
    """Roof with unequal flanks along both axes."""
    return 8.0 - 0.35 * np.abs(x - 3) - 0.25 * np.abs(y + 2) - 0.08 * y


def bowl(x: Floats, y: Floats) -> Floats:
    """Double curvature with a soft channel."""
    return 0.008 * x**2 - 0.006 * y**2 - 2.0 * np.exp(-((x + 0.3 * y - 4) ** 2) / 18)


def valley(x: Floats, y: Floats) -> Floats:
    """Valley with flanks at 45° that runs aslant of all travels."""
    return np.minimum(np.abs(0.5 * x + np.sqrt(0.75) * y), 9.0)


PARTS: dict[str, Scene] = {}


def part(name: str) -> Scene:
    """One of the bench's parts, built once."""
    if name not in PARTS:
        fine = knots(52, 157)
        made = {
            "domes": lambda: solid(domes, fine, fine),
            "steps": lambda: solid(
                steps, knots(52, 27, (-15, -3, 5, 17)), knots(52, 27, (-12, 4, -4, 14))
            ),
            "wedge": lambda: solid(wedge, knots(52, 53, (3,)), knots(52, 53, (-2,))),
            "bowl": lambda: solid(bowl, fine, fine),
            "valley": lambda: solid(valley, fine, fine),
            "plate": lambda: solid(lambda x, _y: np.zeros_like(x), knots(64, 5), knots(64, 5)),
        }
        PARTS[name] = made[name]()
    return PARTS[name]


def datasheet(points: int = 160, effects: Sequence[dict[str, object]] = ()) -> Datasheet:
    """Make a bench sensor: 60 mm line at 100 mm."""
    return Datasheet(
        name="bench",
        working_distance_mm=100.0,
        z_range_mm=60.0,
        x_fov_mm=44.0,
        points_per_profile=points,
        z_resolution_um=2.0,
        repeatability_um=2.0,
        profile_rate_hz=200.0,
        travel_speed_mm_s=80.0,
        triangulation_angle_deg=30.0,
        camera_side="+y",
        line_width_um=120.0,
        wavelength_nm=405.0,
        exposure_s=0.0005,
        camera_rows=1024,
        effects=tuple(effects),
    )


def poses(
    profiles: int,
    *,
    pitch_mm: float = 0.4,
    tilt_deg: tuple[float, float] = (0.0, 0.0),
    heading_deg: float = 0.0,
    shift_mm: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Floats:
    """Straight scan over the part's middle, sensor above looking down."""
    down = np.diag([1.0, -1.0, -1.0])
    turn = (
        Rotation.from_euler("z", heading_deg, degrees=True)
        * Rotation.from_euler("xy", tilt_deg, degrees=True)
    ).as_matrix() @ down
    out = np.tile(np.eye(4), (profiles, 1, 1))
    out[:, :3, :3] = turn
    centre = np.array([0.0, 0.0, 2.0]) + np.array(shift_mm)
    along = (np.arange(profiles) - (profiles - 1) / 2)[:, None] * pitch_mm * turn[:, 1]
    out[:, :3, 3] = centre - 100.0 * turn[:, 2] + along
    return out


VIEWS = (
    {"tilt_deg": (0.0, 0.0), "heading_deg": 0.0, "shift_mm": (0.0, 0.0, 0.0)},
    {"tilt_deg": (9.0, -4.0), "heading_deg": 90.0, "shift_mm": (1.5, -1.0, 3.0)},
    {"tilt_deg": (-7.0, 8.0), "heading_deg": 180.0, "shift_mm": (-2.0, 1.0, -4.0)},
)


def record(
    scene: Scene,
    sheet: Datasheet,
    true_effects: Sequence[dict[str, object]],
    *,
    name: str,
    seed: int,
    profiles: int = 110,
    speckle: PerlinField | None = SPECKLE,
    start_time_s: float | None = None,
    misplaced: float = 1.0,
    **placing: Any,
) -> Recording:
    """Simulate one recording with `true_effects` beyond the sheet's; the true pose is a bit off.

    A part with a reflectance gives an intensity, too.
    """
    from dataclasses import replace

    rng = np.random.default_rng(seed)
    commanded = poses(profiles, **placing)
    error = np.eye(4)
    error[:3, :3] = Rotation.from_rotvec(misplaced * rng.normal(0, MISPLACED[0], 3)).as_matrix()
    error[:3, 3] = misplaced * rng.normal(0, MISPLACED[1], 3)
    time = np.arange(profiles) / sheet.profile_rate_hz
    made = replace(sheet, effects=(*sheet.effects, *true_effects))
    laser = Laser.from_datasheet(sheet)
    view = View(
        scene, SensorModel(made), error @ commanded, time, laser=laser, start_time_s=start_time_s
    )
    streams: dict[str, np.random.Generator] = {}

    def rng_of(stream: str) -> np.random.Generator:
        if stream not in streams:
            streams[stream] = np.random.default_rng([seed, *stream.encode()])
        return streams[stream]

    effects = draw_effects(view.sensor.effects, rng_of)
    law = replace(scan_with(view, None, effects, rng_of)[1], speckle=speckle)
    depth, _ = law.sample(rng_of, view)
    intensity = view.brightness
    if intensity is not None:
        speckled = 1 + BRIGHTNESS_SPECKLE * rng_of("brightness").standard_normal(depth.shape)
        intensity = np.where(np.isfinite(depth), np.clip(intensity * speckled, 0, 1), np.nan)
    return Recording(
        name=name,
        depth_mm=depth,
        intensity=intensity,
        poses=commanded,
        time_s=time,
        start_time_s=start_time_s,
    )
