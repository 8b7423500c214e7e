"""A case: draw its world from a seed, render its recordings, write what strangers get."""

from dataclasses import dataclass, replace
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from challenge.cases import files
from challenge.cases.devices import Scans, draw_earlier_scans, draw_scans
from challenge.cases.makes import Make, first_make, other_make
from challenge.cases.nominal import NoiseLaw, listed_noise, repeatability_um, usual_effects
from challenge.cases.parts import SHAPES, plate, solid_of
from challenge.cases.seeds import child, log_uniform, number
from challenge.cases.switches import DECOY, SINGLE, UNKNOWN, Switch, World
from challenge.instrument.instrument import Casts, Instrument, Path, Solid
from challenge.instrument.optical_surface import OpticalSurface
from challenge.instrument.rays import plant
from challenge.instrument.stripes import first_hits

SWITCHES: dict[str, Switch] = {**SINGLE, **UNKNOWN, **DECOY}
RECORDINGS = ("a", "b", "c")
PLATES = ("plate-1", "plate-2")
BASELINES: tuple[str, ...] = ("base-1", "base-2")
MAKES = "makes"
"""Family of a case whose instrument is of any make; such cases only calibrate."""
EDGE_ON_SHARE = 0.003
_POSES = 40
_DARK = 0.12  # cosine against the sight line; the line of a matt face fades out at about 0.05


@dataclass(frozen=True, kw_only=True, slots=True)
class Secret:
    """What a case hides.

    Attributes
    ----------
    kind
        ``null``, ``one``, ``two``, ``unknown``, ``decoy`` or ``undecidable``.
    switches
        Names of the switches that are on.
    strength
        0 weak, 1 medium, 2 strong.
    shape
        Name of the part.
    recordings
        How many recordings a stranger gets.
    seed
        Entropy of everything drawn in the case.
    family
        ``first`` or ``second``, the family of instruments; or ``makes``.
    plates, baselines
        How many reference plates, and recordings of the instrument in good order, a stranger
        gets; the first family has no baselines.
    aligned
        The part's length lies along the line in each recording.
    doubled
        How often the second family's size of a fault was doubled, so that it shows.
    """

    kind: str
    switches: tuple[str, ...]
    strength: int
    shape: str
    recordings: int
    seed: int
    family: str = "first"
    plates: int = 2
    baselines: int = 0
    aligned: bool = False
    doubled: int = 0

    @classmethod
    def of_key(cls, kept: dict[str, Any]) -> "Secret":
        """Read it from a key's JSON."""
        return cls(**{**kept, "switches": tuple(kept["switches"])})


@dataclass(frozen=True, kw_only=True, slots=True)
class Staged:
    """A case ready to be scanned.

    Attributes
    ----------
    on, off
        The world as it is, and as the maker's file states it; both calibrated.
    good
        The well-made instrument whose file is given.
    make
        What its maker delivers and states.
    plates, baselines
        Paths of the reference scans, and scans of a good part while the instrument was good.
    effects, noise_law
        What the maker's file lists, and the fit behind its noise.
    """

    on: World
    off: World
    good: Instrument
    make: Make
    plates: tuple[Path, ...]
    baselines: Scans
    effects: list[dict[str, Any]]
    noise_law: NoiseLaw
    seed: int


def stage(secret: Secret) -> Staged:
    """Draw a case's world, apply its switches and calibrate the instruments.

    Raises
    ------
    ValueError
        When the part's booleans failed, or no pose keeps the camera from looking along walls.
    """
    shape = solid_of(SHAPES[secret.shape](child(secret.seed, "part")))
    drawn = other_make if secret.family == MAKES else first_make
    make = drawn(child(secret.seed, "instrument"))
    device = make.device
    top = float(np.percentile(shape.vertices_mm[:, 2], 90))
    poses = child(secret.seed, "scans")
    for attempt in range(_POSES):
        scans = draw_scans(poses, device, count=secret.recordings, top_mm=max(top, 0.5),
                           aligned=secret.aligned)  # fmt: skip
        # round parts always have a place that is seen edge-on
        most = EDGE_ON_SHARE * (1 + attempt // 10)
        if all(edge_on(shape, path, device) < most for path in scans.paths):
            break
    else:
        raise ValueError("in every pose the camera looks along some wall")
    wanted = [SWITCHES[name] for name in secret.switches]
    slow = [switch.slow for switch in wanted if switch.slow is not None]
    if slow and slow[0]:
        rate = log_uniform(child(secret.seed, "rate"), 2.0, 5.0)
        scans = replace(scans, paths=tuple(replace(p, rate_hz=rate) for p in scans.paths))
    off = World(device=device, surface=OpticalSurface(), solid=shape, nominal=shape, scans=scans,
                seed=secret.seed)  # fmt: skip
    on = off
    for name in secret.switches:
        on = SWITCHES[name].apply(on, secret.strength, child(secret.seed, "switch", name))
    # a coarse camera is stated; what follows from it is not
    good = replace(device, finder=on.device.finder)
    if "pixel_locking" in secret.switches:
        good = replace(good, camera=on.device.camera)
    off = replace(off, device=good.calibrated(child(secret.seed, "calibration")))
    mine, theirs = on.device, off.device
    if (mine.sheet.waist_mm, mine.camera, mine.finder, mine.plan) == (
        theirs.sheet.waist_mm, theirs.camera, theirs.finder, theirs.plan
    ):  # fmt: skip
        on = replace(on, device=replace(mine, calibration=theirs.calibration))
    else:
        on = replace(on, device=mine.calibrated(child(secret.seed, "calibration")))
    flat = Path(
        start=_above_plate(device),
        direction=1,
        profiles=scans.paths[0].profiles,
        pitch_mm=scans.paths[0].pitch_mm,
        rate_hz=scans.paths[0].rate_hz,
        start_s=0.0,
    )
    plates = tuple(
        replace(flat, start=_shifted(flat.start, 4.0 * k), start_s=1000.0 + 500.0 * k)
        for k in range(len(PLATES))
    )
    maker = child(secret.seed, "maker")
    if make.artefact:
        effects, law = usual_effects(off.device, maker)
    else:
        noise, law = listed_noise(off.device, maker)
        effects = [*make.nominal_edges(), noise]
    earlier = draw_earlier_scans(
        child(secret.seed, "baselines"), device, scans.paths[0], count=secret.baselines,
        top_mm=max(top, 0.5),
    )  # fmt: skip
    return Staged(
        on=on, off=off, good=off.device, make=make, plates=plates, baselines=earlier,
        effects=effects, noise_law=law, seed=secret.seed,
    )  # fmt: skip


def edge_on(solid: Solid, path: Path, device: Instrument) -> float:
    """Share of visible points that the camera sees almost edge-on, hence too dark to read."""
    to_sensor = np.linalg.inv(path.start)
    vertices = solid.vertices_mm @ to_sensor[:3, :3].T + to_sensor[:3, 3]
    camera = device.camera
    y = path.direction * path.pitch_mm * np.arange(0, path.profiles, 4, dtype=np.float64)
    depth, normal, visible = first_hits(plant(vertices, solid.faces), y, camera, every=4)
    slope = np.tan(camera.angles_rad()[::4])
    view = np.stack([-slope * depth, np.full_like(depth, camera.side * camera.base_mm), -depth], -1)
    cosine = np.einsum("gmi,gmi->gm", normal, view) / np.linalg.norm(view, axis=-1)
    with np.errstate(invalid="ignore"):
        dark = visible & (cosine < _DARK)
    return float(dark.sum() / max(visible.sum(), 1))


def _above_plate(device: Instrument) -> NDArray[np.float64]:
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[:3, 3] = (0.0, 9.0, device.camera.working_distance_mm)
    return pose


def _shifted(pose: NDArray[np.float64], x_mm: float) -> NDArray[np.float64]:
    moved = pose.copy()
    moved[0, 3] += x_mm
    return moved


def scan(
    world: World,
    scans: Scans,
    index: int,
    *,
    specimen: int,
    rng: np.random.Generator,
    casts: Casts | None = None,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Scan the case's part in one of its poses; `casts` is one for many specimens."""
    return world.device.scan(
        world.solid,
        world.surface,
        scans.paths[index],
        rng,
        specimen=specimen,
        misplaced=scans.misplaced[index],
        casts=casts,
    )


def write(secret: Secret, staged: Staged, folder: FilePath) -> None:
    """Write recordings, plates, baselines, part and datasheet into an empty folder."""
    folder.mkdir(parents=True, exist_ok=True)
    world, make = staged.on, staged.make

    def deliver(
        name: str, path: Path, shot: tuple[NDArray[np.float32], NDArray[np.float32]]
    ) -> None:
        depth, bright = make.delivered(*shot)
        files.write_recording(folder / f"{name}.h5", depth, bright, path, name, make.even_x_mm())

    for k, name in enumerate(RECORDINGS[: secret.recordings]):
        deliver(name, world.scans.paths[k], scan(
            world, world.scans, k, specimen=number(secret.seed, "specimen"),
            rng=child(secret.seed, "noise", name),
        ))  # fmt: skip
    for k, name in enumerate(BASELINES[: secret.baselines]):
        deliver(name, staged.baselines.paths[k], scan(
            replace(staged.off, solid=staged.off.nominal), staged.baselines, k,
            specimen=number(secret.seed, "specimen", name), rng=child(secret.seed, "noise", name),
        ))  # fmt: skip
    flat = plate(child(secret.seed, "plate"))
    for name, path in zip(PLATES[: secret.plates], staged.plates, strict=False):
        deliver(name, path, world.device.scan(
            flat, OpticalSurface(), path, child(secret.seed, "noise", name),
            specimen=number(secret.seed, "specimen", name),
        ))  # fmt: skip
    files.write_stl(folder / "part.stl", world.nominal)
    repeat = repeatability_um(staged.good, flat, _flat_scans(staged), child(secret.seed, "repeat"))
    sheet = files.datasheet(
        staged.good, world.scans.paths[0], staged.effects, round(repeat, 3)
    )
    even = make.even_x_mm()
    if even is not None:
        sheet |= {"columns": "even_x", "points_per_profile": even.size}
    files.write_yaml(
        folder / "sensor.yaml", {k: v for k, v in sheet.items() if k not in make.left_out}
    )


def _flat_scans(staged: Staged) -> Scans:
    return Scans(paths=staged.plates, misplaced=(np.eye(4),) * len(staged.plates))
