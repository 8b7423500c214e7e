"""One opened case as a story: what was hidden, what the recordings show, what was found."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from challenge.cases.case import RECORDINGS, Secret, Staged, scan
from challenge.cases.seeds import child, number
from challenge.cases.truth import geometry
from challenge.judging.score import has_place
from challenge.proof.panel import robust_sd

Field = NDArray[np.float64]
SEEN = 0.02
"""Largest change over the noise below which a picture of it would show rounding: its choice."""
RIGID = ("roll_deg", "pitch_deg", "yaw_deg", "x_mm", "y_mm", "z_mm")
"""Parameters of an answer's effect that turns and shifts the sensor against its poses."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Scanned:
    """A recording and what the answer expects of it.

    Attributes
    ----------
    depth_mm, simulated_mm, explained_mm : (n, m)
        Readings; their expectation without and with what was found, where the answer places the
        part; NaN where nothing is read, or expected.
    posed_mm, angle_deg : (n, m)
        Rays alone, from where the poses say: depth, and angle between ray and surface normal.
    located : (n, m) bool
        Where the answer sees a departure.
    """

    depth_mm: Field
    simulated_mm: Field
    explained_mm: Field
    posed_mm: Field
    angle_deg: Field
    located: NDArray[np.bool_]

    @property
    def lost(self) -> NDArray[np.bool_]:
        """Readings that are missing where one is expected."""
        return np.isfinite(self.simulated_mm) & ~np.isfinite(self.depth_mm)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Move:
    """A sensor that stands elsewhere than its poses say, in the frame that they speak of.

    Attributes
    ----------
    true, found : (4, 4), None where there is no move
    x_mm, y_mm, surface_mm : (m,), (n,), (n, m)
        Where the rays of the recording meet the part, seen from the commanded middle pose.
    """

    true: Field | None
    found: Field | None
    x_mm: Field
    y_mm: Field
    surface_mm: Field


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Story:
    """What the pictures of a case are drawn from.

    Attributes
    ----------
    scans : of all recordings, the held-out one last
    without_mm : (n, m)
        The held-out recording with the same speckle by the instrument without the fault; None
        where nothing is hidden.
    region : (n, m) bool
        Where the fault matters, None where it has no place.
    move : None where neither the fault nor the answer turns or shifts the sensor
    answer, facts : diagnosis.json, and the key's facts
    """

    scans: tuple[Scanned, ...]
    without_mm: Field | None
    region: NDArray[np.bool_] | None
    move: Move | None
    answer: dict[str, Any]
    facts: dict[str, Any]

    @property
    def held(self) -> Scanned:
        """The held-out recording."""
        return self.scans[-1]

    @property
    def explains(self) -> bool:
        """Whether what was found moves readings by an amount that can be seen.

        A cause of noise moves them a little, too: readings have other weights when they are placed.
        """
        held = self.held
        change = np.abs(held.explained_mm - held.simulated_mm)
        noise = robust_sd(held.depth_mm - held.simulated_mm)
        return bool(np.nanmax(change, initial=0.0) > SEEN * noise)


def tell(out: Path, name: str, case: dict[str, Any], staged: Staged) -> Story | None:
    """Collect one case of a judged set; None where it has no answer.

    Parameters
    ----------
    out, name : folder of the set, and the case
    case : as judged
    staged : the case's world
    """
    answered = out / "answers" / name
    if not (answered / "mismatch.h5").exists():
        return None
    secret = Secret.of_key(case["secret"])
    last = secret.recordings - 1
    scans = tuple(_scanned(out, name, k, staged) for k in range(secret.recordings))
    without, region = None, None
    if secret.switches:
        depth, _ = scan(
            staged.off, staged.off.scans, last, specimen=number(secret.seed, "specimen"),
            rng=child(secret.seed, "noise", RECORDINGS[last]),
        )  # fmt: skip
        without = np.asarray(depth, np.float64)
    maps = out / "keys" / f"{name}.npz"
    if maps.exists() and has_place(case["secret"]):
        region = np.asarray(np.load(maps)["region"], bool)
    answer = json.loads((answered / "diagnosis.json").read_text())
    return Story(
        scans=scans, without_mm=without, region=region, move=_move(case, staged, scans[-1]),
        answer=answer, facts=case["facts"],
    )  # fmt: skip


def _scanned(out: Path, name: str, index: int, staged: Staged) -> Scanned:
    recording = RECORDINGS[index]
    with h5py.File(out / "cases" / name / f"{recording}.h5") as file:
        depth = np.asarray(file["depth"], np.float64)
    with h5py.File(out / "answers" / name / "mismatch.h5") as file:
        group = file[recording]
        simulated, explained = (
            np.asarray(group[key], np.float64) for key in ("simulated", "explained")
        )
        located = np.asarray(group["mask"], bool)
    cast = geometry(staged.off, staged.off.scans.paths[index], np.eye(4))
    return Scanned(
        depth_mm=depth, simulated_mm=simulated, explained_mm=explained, located=located,
        posed_mm=np.where(cast.visible, cast.depth_mm, np.nan),
        angle_deg=np.where(cast.visible, cast.angle_deg, np.nan),
    )  # fmt: skip


def _move(case: dict[str, Any], staged: Staged, held: Scanned) -> Move | None:
    true, found = staged.on.device.motion.mounting(), None
    for effect in case["effects"]:
        given = effect.get("parameters", {})
        if all(key in given for key in RIGID):
            roll, pitch, yaw, *shift = (float(given[key]["value"]) for key in RIGID)
            found = np.eye(4)
            found[:3, :3] = Rotation.from_euler(
                "ZYX", [yaw, roll, pitch], degrees=True
            ).as_matrix()
            found[:3, 3] = shift
    moved = not np.allclose(true, np.eye(4))
    if not moved and found is None:
        return None
    path, camera = staged.off.scans.paths[len(staged.off.scans.paths) - 1], staged.off.device.camera
    along = np.arange(path.profiles, dtype=np.float64) - path.profiles / 2
    return Move(
        true=true if moved else None, found=found, surface_mm=held.posed_mm,
        y_mm=path.direction * path.pitch_mm * along,
        x_mm=camera.working_distance_mm * np.tan(camera.angles_rad()),
    )  # fmt: skip
