"""What a file of the second family says of edges, against what its instrument reads there."""

import numpy as np
import pytest
import yaml

from challenge.cases.case import Secret
from challenge.second.case import datasheet, stage
from challenge.second.device import expected
from challenge.second.edges import off_edges
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet
from sensors.effects import effects_of
from sensors.law import geometric_law
from sensors.model import SensorModel
from sensors.view.view import View

DRAWS = 8


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "shape"), [(31, "terraces"), (32, "corners"), (33, "bosses")])
def test_the_file_describes_edges_as_far_as_a_nominal_line_can(tmp_path, seed, shape):
    secret = Secret(kind="null", switches=(), strength=1, shape=shape, recordings=1, seed=seed,
                    family="second")  # fmt: skip
    staged = stage(secret)
    world = staged.on
    device, travel, place = world.device, world.travels[0], world.misplaced[0]
    shots = np.stack([
        device.scan(world.solid, world.facets, travel, np.random.default_rng(k), specimen=k,
                    misplaced=place)[0]
        for k in range(DRAWS)
    ])  # fmt: skip
    seen = np.isfinite(shots).sum(0)
    mean = np.where(seen > DRAWS / 2, np.nansum(shots, 0) / np.maximum(seen, 1), np.nan)
    smooth = off_edges(expected(device, world.solid, travel, place))
    sd = 1.4826 * np.nanmedian(np.abs(shots - mean)[:, smooth])
    file = tmp_path / "sensor.yaml"
    file.write_text(yaml.safe_dump(datasheet(device, travel, staged.noise_law)))
    sheet = Datasheet.load(file)
    poses = np.einsum("ij,njk->nik", place, travel.poses(device.way))
    scene = Scene(world.solid.vertices_mm, world.solid.faces)
    view = View(scene, SensorModel(sheet), poses, travel.time_s)
    law = geometric_law(view, None)
    for effect in effects_of(sheet):
        law = effect.apply(law, view)
    said = np.where(law.reason == 0, law.mean_mm, np.nan)
    both = np.isfinite(said) & np.isfinite(mean) & ~smooth
    rest = (mean - said - np.nanmedian((mean - said)[smooth])) / sd
    assert np.minimum(np.abs(rest[both]), 10).mean() < 1.3
    against = np.isfinite(said) != np.isfinite(mean)
    assert against[~smooth].mean() < 0.05
    assert against[smooth].mean() < 0.005
