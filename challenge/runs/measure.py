"""`challenge measure`: the scan that a diagnosis proposes, made by the sealed instrument.

A case that one recording can't decide gets a second: the first of the answer's
``next_measurements``, and for comparison a scan drawn at random. Both are diagnosed again.
"""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np

from challenge.cases import files
from challenge.cases.case import RECORDINGS, Secret, scan, stage
from challenge.cases.seeds import child, number
from challenge.runs import scans
from challenge.runs.scans import Change
from challenge.second import case as second
from challenge.second.world import placed
from challenge.sets.sealed import MESHES, commitments_of, write_whole

RANKED, RANDOM = "ranked", "random"
WAYS = (RANKED, RANDOM)
CHANGE = "change.json"
"""What was changed against a case's first scan; written last."""
LATER_S = 120.0
"""After the last recording the further scan begins."""


def folder(out: Path, way: str) -> Path:
    """Where the cases with their further scan are kept."""
    return out / "measured" / way


def answers(out: Path, way: str) -> Path:
    """Where their answers are kept."""
    return out / f"answers-{way}"


def measure(out: Path) -> int:
    """Make the further scans of a set's undecidable cases that have none yet.

    Returns
    -------
    int
        0, or 1 where some answers propose no scan: they count as undecided.
    """
    commitments_of(out)
    made = silent = 0
    for key in sorted((out / "keys").glob("*.key.json")):
        name = key.name.removesuffix(".key.json")
        secret = Secret.of_key(json.loads(key.read_bytes())["secret"])
        if secret.kind != "undecidable":
            continue
        answer = out / "answers" / name / "diagnosis.json"
        if not (out / "answers" / name / "run.json").exists():
            raise ValueError(f"{name} has no answer yet: run `challenge run` first")
        said = json.loads(answer.read_text()) if answer.exists() else None
        wanted = {RANKED: scans.first_proposed(said),
                  RANDOM: scans.drawn(child(secret.seed, "measure"))}  # fmt: skip
        silent += wanted[RANKED] is None
        for way, change in wanted.items():
            if change is not None and not (folder(out, way) / name / CHANGE).exists():
                _take(out, folder(out, way) / name, name, secret, change)
                made += 1
    # which cases these are, and how many, is in the keys alone
    print("further scans are made" if made else "no further scan to make", flush=True)
    return 1 if silent else 0


def _take(out: Path, into: Path, name: str, secret: Secret, change: Change) -> None:
    """Copy a case and add one recording; the change is written last."""
    shutil.rmtree(into, ignore_errors=True)
    into.mkdir(parents=True)
    for file in (out / "cases" / name).iterdir():
        shutil.copyfile(file, into / file.name)
    further = RECORDINGS[secret.recordings]
    make = _second if secret.family == "second" else _first
    make(secret, change, into / f"{further}.h5", further, out / MESHES)
    write_whole(into / CHANGE, json.dumps(change.as_json()).encode())


def _first(secret: Secret, change: Change, file: Path, name: str, _meshes: Path) -> None:
    staged = stage(secret)
    world, path = staged.on, staged.on.scans.paths[0]
    start = change.moved(path.start, np.array([0.0, path.direction, 0.0]),
                         path.pitch_mm * (path.profiles - 1),
                         world.device.camera.working_distance_mm)  # fmt: skip
    again = replace(path, start=start, rate_hz=path.rate_hz / change.slower,
                    start_s=world.scans.paths[-1].start_s + LATER_S)  # fmt: skip
    place = second.drawn_place(child(secret.seed, "measure", "place"))
    more = replace(world.scans, paths=(again,), misplaced=(place,))
    depth, bright = staged.make.delivered(*scan(
        world, more, 0, specimen=number(secret.seed, "specimen"),
        rng=child(secret.seed, "noise", name),
    ))  # fmt: skip
    files.write_recording(file, depth, bright, again, name, staged.make.even_x_mm())


def _second(secret: Secret, change: Change, file: Path, name: str, meshes: Path) -> None:
    world = second.stage(secret, meshes).on
    device, travel = world.device, world.travels[0]
    start = change.moved(travel.start, device.way, float(travel.travel_mm[-1]), device.distance_mm)
    again = replace(travel, start=start, rate_hz=travel.rate_hz / change.slower,
                    start_s=world.travels[-1].start_s + LATER_S)  # fmt: skip
    place = second.drawn_place(child(secret.seed, "measure", "place"))
    more = replace(world, travels=(again,), misplaced=(place,))
    depth, bright = device.scan(
        more.solid, more.facets, again, child(secret.seed, "noise", name),
        specimen=number(secret.seed, "specimen"), misplaced=placed(more, 0),
    )  # fmt: skip
    files.write_delivered(
        file, depth.astype(np.float32), bright.astype(np.float32), again.poses(device.way),
        again.time_s, again.start_s, name, x_mm=device.camera.even_mm,
    )  # fmt: skip
