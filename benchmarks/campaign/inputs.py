"""Mutated instruments' files and recordings for import, roughness and diagnose."""

from pathlib import Path

import h5py
import numpy as np
import trimesh

from benchmarks.campaign.sandbox import Outcome, run
from tests.support.instrument_files import files, heights
from tests.support.mutation import of_bytes

PITCH = ["--pitch-x-mm", "0.2", "--pitch-y-mm", "0.2", "--no-check"]


def recording(path: Path, rng: np.random.Generator, shift: float = 0.0) -> None:
    """Write a recording of the step."""
    z = heights(rng)
    poses = np.tile(np.diag([1.0, -1.0, -1.0, 1.0]), (24, 1, 1))
    poses[:, 1, 3] = 0.2 * np.arange(24) + shift
    poses[:, 2, 3] = 120.0
    with h5py.File(path, "w") as file:
        file.attrs["format"] = "profilometer-recording"
        file.attrs["version"] = 1
        file.create_dataset("depth", data=(120.0 - z).astype(np.float32))
        file.create_dataset("pose", data=poses)
        file.create_dataset("time", data=0.002 * np.arange(24))
        file.create_dataset("x", data=0.2 * np.arange(30))


def case(folder: Path, rng: np.random.Generator) -> Outcome:
    """Mutate one file and give it to import, roughness or diagnose."""
    if rng.uniform() < 0.15:
        return _diagnose(folder, rng)
    made = files(rng)
    name = str(rng.choice(sorted(made)))
    (folder / name).write_bytes(of_bytes(made[name], rng))
    if rng.uniform() < 0.8:
        extra = PITCH if rng.uniform() < 0.7 else []
        return run(["import", name, "--as", "r.h5", *extra], folder)
    return run(["roughness", name, "--out", "s.yaml", "--pitch-x-mm", "0.2"], folder)


def _diagnose(folder: Path, rng: np.random.Generator) -> Outcome:
    names = [f"r{k}.h5" for k in range(2)]
    for k, name in enumerate(names):
        recording(folder / name, rng, 0.1 * k)
    box = trimesh.creation.box((8.0, 8.0, 4.0))
    box.apply_translation((3.0, 2.4, 18.0))
    box.export(folder / "part.stl")
    (folder / "sensor.yaml").write_text(
        "name: s\nworking_distance_mm: 100\nz_range_mm: 60\nx_fov_mm: 6\npoints_per_profile: 30\n"
        "z_resolution_um: 0.1\nrepeatability_um: 5\nprofile_rate_hz: 500\ncolumns: even_x\n"
    )
    victim = str(rng.choice([*names, "part.stl", "sensor.yaml"]))
    path = folder / victim
    path.write_bytes(of_bytes(path.read_bytes(), rng))
    words = ["diagnose", *names, "--part", "part.stl", "--sensor", "sensor.yaml", "--out", "d"]
    return run(words, folder)
