"""Public meshes, those that libraries ship, and mutated ones: a clear error or an honest repair."""

import sysconfig
from pathlib import Path

import numpy as np
import trimesh
import yaml

from benchmarks.campaign.sandbox import Outcome, run
from tests.support.mutation import of_bytes
from tests.support.small_recipe import RECIPE, SENSOR, SURFACE

SUFFIXES = (".stl", ".obj", ".ply", ".3mf")


def shipped() -> list[Path]:
    """Return mesh files in the installed packages, and public ones in a folder if one is given."""
    site = Path(sysconfig.get_paths()["purelib"])
    return sorted(path for path in site.rglob("*") if path.suffix.lower() in SUFFIXES)


def of_file(folder: Path, mesh: Path) -> Outcome:
    """Scan a mesh as it is."""
    (folder / mesh.name).write_bytes(mesh.read_bytes())
    return _scan(folder, mesh.name)


def case(folder: Path, rng: np.random.Generator) -> Outcome:
    """Mutate a small mesh and scan it."""
    made = {
        "box": trimesh.creation.box((30, 20, 10)),
        "ball": trimesh.creation.icosphere(subdivisions=2, radius=15),
        "tube": trimesh.creation.annulus(5, 12, 20),
    }[str(rng.choice(["box", "ball", "tube"]))]
    suffix = str(rng.choice(SUFFIXES))
    blob = made.export(file_type=suffix[1:])
    data = blob.encode() if isinstance(blob, str) else blob
    (folder / f"a{suffix}").write_bytes(of_bytes(data, rng))
    return _scan(folder, f"a{suffix}")


def _scan(folder: Path, name: str) -> Outcome:
    recipe = {**RECIPE, "parts": [{"path": name}], "flaws": {"dent": 1}}
    (folder / "recipe.yaml").write_text(yaml.safe_dump(recipe, sort_keys=False))
    (folder / "sensor.yaml").write_text(yaml.safe_dump(SENSOR))
    (folder / "surface.yaml").write_text(yaml.safe_dump(SURFACE))
    return run(["generate", "recipe.yaml", "--out", "out"], folder)
