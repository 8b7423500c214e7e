"""A recipe, a sensor and a surface that make one small scan in a second."""

from pathlib import Path

import yaml

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


def write_shards(folder: Path, **changes: object) -> Path:
    """Write a recipe of several shards, with its sensor and surface; return its path."""
    wanted = {"specimens": 4, "scans": 2, "scans_per_shard": 2, **changes}
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "recipe.yaml").write_text(yaml.safe_dump({**RECIPE, **wanted}, sort_keys=False))
    (folder / "sensor.yaml").write_text(yaml.safe_dump(SENSOR))
    (folder / "surface.yaml").write_text(yaml.safe_dump(SURFACE))
    return folder / "recipe.yaml"
