"""Recordings of a handful of profiles are diagnosed, or refused before any work."""

from dataclasses import replace

import pytest
import trimesh

from diagnosis.diagnose import diagnose
from diagnosis.prepare import Inputs
from files.errors import RecipeError
from sensors.datasheet import Datasheet
from sensors.recording import Recording


@pytest.fixture(scope="module")
def faults(shared_dir):
    folder = shared_dir / "faults" / "few_profiles"
    if not folder.is_dir():
        pytest.skip("no recordings of few profiles beside the checkout")
    return folder


def diagnosed(folder, count, progress=lambda text: None):
    mesh = trimesh.load(folder / "step.stl")
    recordings = []
    for path in sorted(folder.glob("step-*.h5")):
        whole = Recording.load(path)
        recordings.append(
            replace(
                whole, depth_mm=whole.depth_mm[:count], poses=whole.poses[:count],
                time_s=whole.time_s[:count],
            )
        )  # fmt: skip
    sheet = Datasheet.load(folder / "sensor.yaml")
    inputs = Inputs(
        recordings=recordings, vertices_mm=mesh.vertices, faces=mesh.faces, datasheet=sheet
    )
    return diagnose(inputs, progress=progress)


@pytest.mark.parametrize("count", [4, 5, 6])
def test_as_simulated_few_profiles_match(faults, count):
    """Of five profiles a placement explains all that a trend over the profiles could."""
    assert diagnosed(faults, count).verdict == "match"


@pytest.mark.parametrize("count", [1, 2, 3])
def test_fewer_are_refused_before_any_work(faults, count):
    said = []
    with pytest.raises(RecipeError, match=f"too few profiles.*got {count}; allowed: at least 4"):
        diagnosed(faults, count, said.append)
    assert said == []
