"""Mutated recipes, sensors and surfaces: each is answered in one line, or makes its few scans."""

from pathlib import Path

import numpy as np
import yaml

from benchmarks.campaign.mutate import LINES, of_bytes, of_data
from benchmarks.campaign.sandbox import Outcome, run

SENSOR = {
    "name": "small", "working_distance_mm": 100.0, "z_range_mm": 60.0, "x_fov_mm": 40.0,
    "points_per_profile": 24, "z_resolution_um": 2.0, "repeatability_um": 1.0,
    "profile_rate_hz": 500.0, "triangulation_angle_deg": 30.0, "line_width_um": 120.0,
    "wavelength_nm": 405.0, "camera_rows": 512,
    "effects": [{"name": "line_bow", "sag_um": 20.0}, {"name": "camera_occlusion"}],
}  # fmt: skip
SURFACE = {
    "name": "rough", "rpm_mm": 0.02, "rvm_mm": 0.02, "pc_per_mm": 0.2, "pitch_x_mm": 1.7,
    "pitch_y_mm": 1.0,
}  # fmt: skip
RECIPE = {
    "name": "small", "seed": 3, "sensor": "sensor.yaml", "surface": "surface.yaml", "profiles": 12,
    "points": 24, "specimens": 1, "scans": 1, "splits": {"train": 0.5, "test": 0.5},
    "parts": [
        {"builtin": "steel_plate", "parameters": {"length_mm": 60.0, "width_mm": 50.0,
                                                  "thickness_mm": 14.0}},
    ],
    "flaws": {
        "min_distance_mm": 1, "keep_free": [[[-5, -5, 0], [-4, -4, 9]]],
        "dent": {"number": {"choice": [0, 1]}, "length_mm": {"log_uniform": [3, 8]},
                 "tiers": {"minor": {"weight": 3, "scale": 0.5}}},
        "scratch": 1, "edge_chip": {"number": 1},
    },
    "motion": {
        "look": [0, 0, -1], "travel": [0, 1, 0], "length_mm": {"uniform": [20, 30]},
        "roll_deg": {"uniform": [-5, 5]}, "direction": {"choice": [-1, 1]}, "aim_at_flaws": 0.7,
    },
    "visible_at": 3,
}  # fmt: skip


def case(folder: Path, rng: np.random.Generator) -> Outcome:
    """Mutate one of the three files and generate."""
    files = {"recipe.yaml": RECIPE, "sensor.yaml": SENSOR, "surface.yaml": SURFACE}
    for name, data in files.items():
        (folder / name).write_text(yaml.safe_dump(data, sort_keys=False))
    name = str(rng.choice(["recipe.yaml"] * 4 + ["sensor.yaml", "surface.yaml"]))
    path = folder / name
    way = rng.uniform()
    if way < 0.6:
        text = yaml.dump(of_data(files[name], rng), sort_keys=False, allow_unicode=True)
        path.write_bytes(text.encode("utf-8", "surrogatepass"))
    elif way < 0.9:
        path.write_bytes(of_bytes(path.read_bytes(), rng))
    else:
        line = LINES[int(rng.integers(len(LINES)))]
        before = path.read_text()
        path.write_text(line + before if rng.uniform() < 0.5 else before + line)
    return run(["generate", "recipe.yaml", "--out", "out"], folder)
