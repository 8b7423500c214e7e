"""A dataset from real CAD files: every file becomes a part, broken ones are named."""

import pytest

from pipeline.batch.run import Backend, generate
from pipeline.dataset.verify import verify
from pipeline.recipe import Recipe

RECIPE = """\
name: real-parts
seed: 11
sensor: KEYENCE-LJ-X8200
surface: car_door
profiles: 120
points: 160
scans: 2
parts:
  - {path: cad/angle_block.STL, unit: inch}
  - {path: cad/ADIS16480.STL, unit: m}
  - {path: cad/featuretype.STL, unit: inch}
  - {path: cad/idler_riser.STL, unit: inch}
  - {path: cad/octagonal_pocket.stl, unit: m}
  - {path: cad/plate_holes.STL}
  - {path: cad/torus.STL, unit: inch}
  - {path: cad/round.stl}
  - {path: cad/box.STL, unit: inch}
  - {path: broken/stl_empty_*.stl}
flaws:
  min_distance_mm: 0.5
  dent: {number: 1, length_mm: {uniform: [2, 4]}, depth_mm: {uniform: [0.1, 0.3]}}
  pit: 1
  scratch: {number: 1, length_mm: {uniform: [3, 6]}}
motion:
  length_mm: {uniform: [20, 40]}
  yaw_deg: {uniform: [-45, 45]}
"""


@pytest.mark.slow
def test_real_parts_become_a_dataset(shared_dir, tmp_path):
    (tmp_path / "recipe").mkdir()
    path = tmp_path / "recipe" / "real.yaml"
    path.write_text(RECIPE)
    recipe = Recipe.load(path, roots=(shared_dir / "meshes",))
    said = generate(recipe, tmp_path / "out", backend=Backend(jobs=1))
    assert said["scans"] == 18
    assert len(said["parts"]) == 9
    assert {failed["part"] for failed in said["failed"]} == {"stl_empty_ascii", "stl_empty_bin"}
    assert all(".stl" in failed["why"] for failed in said["failed"])
    assert said["statistics"]["by_class"]["dent"]["visible"] > 4
    assert verify(tmp_path / "out").wrong == 0
