"""Cases of the second family: draw a world, calibrate it, write what strangers get."""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from challenge.cases import files
from challenge.cases.case import BASELINES, PLATES, RECORDINGS, Secret
from challenge.cases.nominal import NoiseLaw
from challenge.cases.parts import SHAPES, plate, solid_of
from challenge.cases.seeds import child, number
from challenge.second.camera import Camera
from challenge.second.device import Device, Travel
from challenge.second.exposures import Exposures
from challenge.second.facets import Facets
from challenge.second.firmware import Firmware
from challenge.second.meshes import MARK, solid_of_file
from challenge.second.nominal import measured_noise
from challenge.second.robot import Robot
from challenge.second.slit import Slit
from challenge.second.switches import FAULTS
from challenge.second.world import Parameters, World, placed

SIZES = (0.2, 0.4, 0.8)
"""Of weak, medium and strong faults: about half of them are concealed from the paper's checks."""
MISPLACED_RAD, MISPLACED_MM = 3.5e-4, 0.03
LEAST_READ = 0.02
"""Share of readings below which a recording is of nothing: the part was out of range."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Staged:
    """A case ready to be scanned: the world as it is, and as its maker knows it."""

    on: World
    off: World
    plates: tuple[Travel, ...]
    baselines: tuple[Travel, ...]
    left_out: tuple[str, ...]
    noise_law: NoiseLaw


def draw_device(rng: np.random.Generator, *, slow: bool) -> Device:
    """Draw an instrument of an ordinary, well-made kind."""
    row = float(rng.uniform(0.03, 0.04))
    theta = float(np.radians(rng.uniform(23, 32)))
    columns = int(rng.integers(150, 190))
    camera = Camera(
        theta_rad=theta, side=int(rng.choice([-1, 1])),
        rows=int(8 * np.ceil(14 * np.sin(theta) / row / 8)), row_pitch_mm=row, columns=columns,
        x_fov_mm=round(columns * float(rng.uniform(0.09, 0.12)), 2),
        bend_rows=float(rng.uniform(-2, 2)), shear_rows=float(rng.uniform(-1, 1)),
        barrel=float(rng.uniform(-0.02, 0.02)),
    )  # fmt: skip
    return Device(
        slit=Slit(width_mm=float(rng.uniform(0.06, 0.08)), blur_mm=float(rng.uniform(0.02, 0.03)),
                  coherence=float(rng.uniform(0.2, 0.6))),
        camera=camera, finder=str(rng.choice(["strongest", "gaussian"])),
        firmware=Firmware(step_mm=2.5e-4 if rng.random() < 0.5 else 4e-3),
        robot=Robot(wander_mm=2e-4, wander_rad=2e-6),
        distance_mm=round(float(rng.uniform(90, 150)), 1),
        exposure_s=2e-4 if slow else 2e-5,
        exposures=Exposures(ratio=float(rng.choice([1.0, 1.0, 1.0, 8.0]))),
    )  # fmt: skip


def travel_over(
    rng: np.random.Generator, device: Device, turn_deg: float, pitch: float, rate: float,
    profiles: int, clock: float, aim: NDArray[np.float64], lean_deg: float,
) -> Travel:  # fmt: skip
    """Scan over a place of the part, the camera's axis along the part's -z but for a lean."""
    theta, side = device.camera.theta_rad, device.camera.side
    face = Rotation.from_euler("x", 180, degrees=True)
    spin = Rotation.from_euler("z", turn_deg, degrees=True)
    lean = Rotation.from_euler("xy", rng.uniform(-lean_deg, lean_deg, 2), degrees=True)
    incline = Rotation.from_euler("x", -side * theta)  # the sheet leans, the camera is upright
    turn = (spin * lean * face * incline).as_matrix()
    start = np.eye(4)
    start[:3, :3] = turn
    middle = device.way * pitch * (profiles - 1) / 2 + np.array([0, 0, device.distance_mm])
    start[:3, 3] = aim - turn @ middle
    return Travel(start=start, profiles=profiles, pitch_mm=pitch, rate_hz=rate,
                  start_s=round(clock, 3))  # fmt: skip


def stage(secret: Secret, meshes: Path | None = None) -> Staged:
    """Draw a case's world, apply its faults and calibrate the instrument.

    Parameters
    ----------
    meshes
        Folder of the set's meshes, where it has some.

    Raises
    ------
    ValueError
        When the part's booleans failed, or its mesh is missing.
    """
    if secret.shape.startswith(MARK):
        if meshes is None:
            raise ValueError(f"part {secret.shape}: needs the set's meshes")
        shape = solid_of_file(meshes / secret.shape.removeprefix(MARK))
    else:
        shape = solid_of(SHAPES[secret.shape](child(secret.seed, "part")))
    faults = [FAULTS[name] for name in secret.switches]
    rng = child(secret.seed, "scans")
    slow = any(f.slow for f in faults) or rng.random() < 0.3
    device = draw_device(child(secret.seed, "instrument"), slow=slow)
    top = float(np.percentile(shape.vertices_mm[:, 2], 90))
    rate = float(rng.uniform(1.5, 3.0) if slow else rng.uniform(100, 300))
    pitch, profiles, clock = float(rng.uniform(0.09, 0.12)), int(rng.integers(120, 150)), 20.0
    travels = []
    turns = rng.permutation([0.0, 180.0, 90.0, 270.0, 45.0])
    for turn in turns[: secret.recordings + len(BASELINES)]:
        aim = np.array([*rng.uniform(-2, 2, 2), max(top, 0.5) / 2 + rng.uniform(-0.5, 0.5)])
        angle = float(turn + rng.uniform(-12, 12))
        if secret.aligned:
            angle = 180.0 * round(angle / 180.0)
        travels.append(travel_over(rng, device, angle, pitch, rate, profiles, clock, aim, 6.0))
        clock += profiles / rate + float(rng.uniform(20, 120))
    misplaced = [drawn_place(rng) for _ in travels]
    plates = tuple(
        travel_over(rng, device, 90.0 * k, pitch, rate, profiles, 3000.0 + 500 * k,
                np.array([2.0 * k, 0.0, 0.0]), 2.0)
        for k in range(len(PLATES))
    )  # fmt: skip
    off = World(device=device, facets=Facets(), solid=shape, nominal=shape,
                travels=tuple(travels), misplaced=tuple(misplaced), mounting=np.eye(4),
                seed=secret.seed)  # fmt: skip
    on = off
    for name, fault in zip(secret.switches, faults, strict=True):
        size = SIZES[secret.strength] * 2**secret.doubled
        on = fault.apply(on, size, child(secret.seed, "fault", name))
    dropped = child(secret.seed, "file").permutation(files.OPTIONAL)[: len(files.OPTIONAL) // 2]
    good = calibrated(off, secret.seed)
    return Staged(
        on=calibrated(on, secret.seed), off=good, plates=plates,
        baselines=tuple(travels[secret.recordings :]), left_out=tuple(sorted(map(str, dropped))),
        noise_law=measured_noise(good.device, child(secret.seed, "noise law")),
    )  # fmt: skip


def drawn_place(rng: np.random.Generator) -> NDArray[np.float64]:
    """Draw the rigid error (4, 4) with which a part is laid under the instrument."""
    error = np.eye(4)
    error[:3, :3] = Rotation.from_rotvec(rng.normal(0, MISPLACED_RAD, 3)).as_matrix()
    error[:3, 3] = rng.normal(0, MISPLACED_MM, 3)
    return error


def calibrated(world: World, seed: int) -> World:
    """Calibrate a world's instrument as it is."""
    device = world.device.calibrated(
        child(seed, "calibration"), gauge_stretch=world.gauge_stretch,
        plate_bow_mm=world.plate_bow_mm,
    )  # fmt: skip
    return replace(world, device=device)


def withhold(secret: Secret, folder: Path) -> None:
    """Take away the reference plates and baselines that a stranger doesn't get."""
    for name in (*PLATES[secret.plates :], *BASELINES[secret.baselines :]):
        (folder / f"{name}.h5").unlink()


def write(secret: Secret, staged: Staged, folder: Path) -> None:
    """Write recordings, all baselines and plates, part and datasheet into an empty folder."""
    folder.mkdir(parents=True, exist_ok=True)
    specimen = number(secret.seed, "specimen")

    def take(world: World, solid: Any, facets: Facets, travel: Travel, name: str, marks: int,
             misplaced: NDArray[np.float64]) -> None:  # fmt: skip
        depth, bright = world.device.scan(
            solid, facets, travel, child(secret.seed, "noise", name), specimen=marks,
            misplaced=misplaced,
        )  # fmt: skip
        files.write_delivered(
            folder / f"{name}.h5", depth.astype(np.float32), bright.astype(np.float32),
            travel.poses(world.device.way), travel.time_s, travel.start_s, name,
            x_mm=world.device.camera.even_mm,
        )  # fmt: skip

    on, off, count = staged.on, staged.off, secret.recordings
    for k, (name, travel) in enumerate(zip(RECORDINGS[:count], on.travels, strict=False)):
        take(on, on.solid, on.facets, travel, name, specimen, placed(on, k))
    for k, (name, travel) in enumerate(zip(BASELINES, staged.baselines, strict=True)):
        other = number(secret.seed, "specimen", name)
        take(off, off.nominal, off.facets, travel, name, other, off.misplaced[count + k])
    for name, travel in zip(PLATES, staged.plates, strict=True):
        flat = plate(child(secret.seed, "plate"))
        take(off, flat, Facets(), travel, name, number(secret.seed, "specimen", name), np.eye(4))
    files.write_stl(folder / "part.stl", off.nominal)
    device = on.device if "coarse chip" in secret.switches else off.device
    stated = datasheet(device, on.travels[0], staged.noise_law)
    files.write_yaml(
        folder / "sensor.yaml", {k: v for k, v in stated.items() if k not in staged.left_out}
    )


def all_read(folder: Path) -> bool:
    """Whether each recording, baseline and plate in a case's folder has readings."""
    for file in folder.glob("*.h5"):
        with h5py.File(file) as stored:
            if np.isfinite(np.asarray(stored["depth"])).mean() < LEAST_READ:
                return False
    return True


def datasheet(device: Device, travel: Travel, noise: NoiseLaw) -> dict[str, Any]:
    """Nominal datasheet, as the maker prints it: shadows, merged levels and the noise of slopes."""
    camera = device.camera
    theta = float(np.degrees(camera.theta_rad))
    side = "+y" if camera.side > 0 else "-y"
    spread_um = round(1e3 * device.slit.width_mm / 12**0.5, 2)  # of a flat top
    return {
        "name": "profilometer", "working_distance_mm": device.distance_mm,
        "z_range_mm": device.z_range_mm, "x_fov_mm": camera.x_fov_mm,
        "points_per_profile": camera.columns,
        "z_resolution_um": round(1e3 * device.firmware.step_mm, 6), "repeatability_um": 2.0,
        "profile_rate_hz": travel.rate_hz, "travel_speed_mm_s": travel.pitch_mm * travel.rate_hz,
        "columns": "even_x", "triangulation_angle_deg": round(theta, 4), "camera_side": side,
        "line_width_um": round(1e3 * device.slit.width_mm, 1), "wavelength_nm": 450.0,
        "exposure_s": device.exposure_s, "camera_rows": camera.rows,
        "effects": [
            {"name": "camera_occlusion", "triangulation_angle_deg": round(theta, 4),
             "camera_side": side, "line_sd_um": spread_um},
            {"name": "finite_spot", "line_sd_um": spread_um,
             "along_um": round(1e3 * camera.footprint_mm, 1)},
            {"name": "edge_mixing", "line_sd_um": spread_um},
            {"name": "incidence_noise", "exponent": noise.exponent, "lean": noise.lean},
        ],
    }  # fmt: skip


def known_of(secret: Secret, staged: Staged) -> dict[str, Any]:
    """Return what a key holds beside the secret."""
    world = staged.on
    parameters: Parameters = {}
    for name in secret.switches:
        parameters |= FAULTS[name].parameters(world)
    return {
        "left_out": list(staged.left_out), "noise_law": asdict(staged.noise_law),
        "parameters": parameters,
        "switched": {
            "facets": asdict(world.facets), "robot": asdict(world.device.robot),
            "warmth": asdict(world.device.warmth), "firmware": asdict(world.device.firmware),
            "slit": asdict(world.device.slit), "camera": asdict(world.device.camera),
            "window": asdict(world.device.window), "air": asdict(world.device.air),
            "exposures": asdict(world.device.exposures), "sparks": world.device.sparks,
            "gauge_stretch": world.gauge_stretch, "plate_bow_mm": world.plate_bow_mm,
        },
    }  # fmt: skip
