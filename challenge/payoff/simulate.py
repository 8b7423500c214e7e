"""Plain and diagnosed simulation: `flawforge generate` over the same solids and paths."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path as FilePath
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from challenge.cases.files import write_yaml
from challenge.payoff.specimens import Specimen, write_obj
from challenge.sets.processes import ONE_CORE

Brightness = Callable[[NDArray[np.float64]], NDArray[np.float64]]

_ART_MM = (40.0, 34.0)  # what a print's drawing covers of the part's x-y plane
_ART_PIXEL_MM = 0.04


def flawforge(arguments: list[str], folder: FilePath) -> None:
    """Run a command of flawforge as a stranger would, on one core.

    Raises
    ------
    ValueError
        Where it fails, with the last that it said.
    """
    done = subprocess.run(
        [sys.executable, "-m", "flawforge.cli", *arguments], cwd=folder,
        env={**os.environ, **ONE_CORE}, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        text=True, check=False,
    )  # fmt: skip
    (folder / f"{arguments[0]}.log").write_text(done.stdout)
    if done.returncode != 0:
        last = (done.stdout.strip().splitlines() or ["said nothing"])[-1]
        raise ValueError(f"{folder}: {arguments[0]} failed ({done.returncode}): {last}")


def write_parts(folder: FilePath, specimens: list[Specimen]) -> None:
    """Write the flawed solids as parts of a recipe."""
    folder.mkdir(parents=True, exist_ok=True)
    for k, specimen in enumerate(specimens):
        write_obj(folder / f"part-{k:03d}.obj", specimen.solid)


def write_artwork(file: FilePath, brightness: Brightness) -> None:
    """Write a print's drawing, which the maker of the part has, as a picture."""
    from matplotlib.image import imsave

    columns, rows = (int(size / _ART_PIXEL_MM) for size in _ART_MM)
    x = (np.arange(columns) + 0.5) * _ART_PIXEL_MM - _ART_MM[0] / 2
    y = _ART_MM[1] / 2 - (np.arange(rows) + 0.5) * _ART_PIXEL_MM
    plane = np.stack([*np.meshgrid(x, y), np.zeros((rows, columns))], -1)
    imsave(file, brightness(plane), cmap="gray", vmin=0.0, vmax=1.0)


def recipe(
    specimens: list[Specimen], *, seed: int, sensor: str, surface: str, parts: str, columns: int,
    artwork: str | None,
) -> dict[str, Any]:  # fmt: skip
    """Return a recipe that scans each specimen once, on its own path, and cuts no flaws."""
    entries = []
    profiles = specimens[0].instance.shape[0]
    for k, specimen in enumerate(specimens):
        start = specimen.sight.start
        begin = start[:3, 3]
        # one pitch beyond the last profile, so that rounding can't cut it off
        run = profiles * specimen.sight.run
        motion = {
            "look": [float(v) for v in start[:3, 2]],
            "travel": [float(v) for v in start[:3, 1]],
            "path": {
                "waypoints": [
                    {"at_mm": [float(v) for v in begin]},
                    {"at_mm": [float(v) for v in begin + run]},
                ]
            },
        }
        entries.append({"path": f"{parts}/part-{k:03d}.obj", "motion": motion})
    made: dict[str, Any] = {
        "name": "payoff", "seed": seed, "sensor": sensor, "surface": surface,
        "profiles": profiles, "points": columns, "parts": entries,
    }  # fmt: skip
    if artwork is not None:
        made["reflectance"] = {
            "picture": {
                "path": artwork,
                "x_mm": [-_ART_MM[0] / 2, _ART_MM[0] / 2],
                "y_mm": [-_ART_MM[1] / 2, _ART_MM[1] / 2],
            }
        }
    return made


def generate(
    folder: FilePath, name: str, specimens: list[Specimen], *, seed: int, sensor: str,
    surface: str, columns: int, artwork: str | None,
) -> list[NDArray[np.float32]]:  # fmt: skip
    """Simulate the scans of all specimens.

    Parameters
    ----------
    folder
        Holds ``parts/`` and the files of sensor and surface.
    name
        Of the dataset, a folder beside them.

    Returns
    -------
    list of (profiles, columns) float32
        Readings in mm, NaN where missing, in the order of the specimens.
    """
    if not (folder / name / "dataset.json").exists():
        made = recipe(specimens, seed=seed, sensor=sensor, surface=surface, parts="parts",
                      columns=columns, artwork=artwork)  # fmt: skip
        write_yaml(folder / f"recipe-{name}.yaml", made)
        flawforge(["generate", f"recipe-{name}.yaml", "--out", name], folder)
    return read_depths(folder / name, len(specimens))


def read_depths(dataset: FilePath, count: int) -> list[NDArray[np.float32]]:
    """Read the readings of a dataset of one scan for each part, sorted by part."""
    found: dict[str, NDArray[np.float32]] = {}
    for shard in sorted(dataset.glob("shard-*.h5")):
        with h5py.File(shard) as file:
            depth = file["depth"]
            for row, scan in enumerate(file["scan_id"].asstr()[:]):
                counts = depth[row]
                values = counts.astype(np.float64)
                if "scale_mm" in depth.attrs:
                    values = values * depth.attrs["scale_mm"] + depth.attrs["offset_mm"]
                    values[counts == depth.attrs["missing"]] = np.nan
                found[scan] = values.astype(np.float32)
    if len(found) != count:
        said = json.loads((dataset / "dataset.json").read_text()).get("failed", "")
        raise ValueError(f"{dataset}: {len(found)} of {count} scans; {str(said)[:500]}")
    return [found[name] for name in sorted(found)]
