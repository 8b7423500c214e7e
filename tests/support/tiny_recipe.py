"""A recipe whose dataset is made in a second or two."""

from pathlib import Path

SENSOR = """\
name: bench sensor
working_distance_mm: 100.0
z_range_mm: 40.0
x_fov_mm: 40.0
points_per_profile: 80
z_resolution_um: 2.0
repeatability_um: 1.0
profile_rate_hz: 1000.0
triangulation_angle_deg: 30.0
"""
RECIPE = """\
name: tiny
seed: 0
sensor: sensor.yaml
surface: car_door
profiles: 40
specimens: 3
scans: 2
scans_per_shard: 2
splits: {train: 0.5, test: 0.5}
parts:
  - builtin: steel_plate
    name: a
    parameters: {length_mm: 60, width_mm: 50, thickness_mm: 5, edge_radius_mm: 2}
  - builtin: steel_plate
    name: b
    parameters: {length_mm: 80, width_mm: 50, thickness_mm: 5, edge_radius_mm: 2}
flaws:
  dent: {number: 1, length_mm: {uniform: [6, 9]}, depth_mm: 0.5}
  pit: {number: {choice: [0, 2]}}
motion:
  length_mm: 25
  yaw_deg: {uniform: [-10, 10]}
  aim_jitter: 0.2
"""


def write_recipe(folder: Path) -> Path:
    folder.mkdir()
    (folder / "sensor.yaml").write_text(SENSOR)
    (folder / "tiny.yaml").write_text(RECIPE)
    return folder / "tiny.yaml"
