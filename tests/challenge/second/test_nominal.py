"""What a maker of the second family states of noise and reach, against its instrument."""

import numpy as np
import pytest
import yaml

from challenge.cases.case import Secret
from challenge.cases.seeds import child
from challenge.second.case import datasheet, stage
from challenge.second.device import expected
from challenge.second.edges import off_edges
from challenge.second.nominal import noise_on_plane
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet
from sensors.effects import effects_of
from sensors.law import geometric_law
from sensors.model import SensorModel
from sensors.view.view import View

DRAWS, BLOCK = 12, 6


def test_the_stated_noise_is_that_of_a_plate_which_leans_from_the_camera():
    secret = Secret(kind="null", switches=(), strength=1, shape="waves", recordings=1, seed=5,
                    family="second")  # fmt: skip
    staged = stage(secret)
    device, law = staged.off.device, staged.noise_law
    level = device.way[2] / device.way[1]
    level_mm, leaning_mm = (
        noise_on_plane(device, 0.0, level + lean, 60, child(7, str(lean)))
        for lean in (0.0, -0.6 * device.camera.side)
    )
    stated = (1 + (level - 0.6 * device.camera.side) ** 2) / (1 + level**2)
    stated = stated ** (law.exponent / 2) * np.exp(-0.6 * device.camera.side * law.lean)
    assert law.worst < 0.15
    assert stated < 0.9
    assert abs(leaning_mm / level_mm / stated - 1) < 0.15


@pytest.mark.slow
def test_a_curved_part_is_read_as_far_along_the_line_as_the_file_says(tmp_path):
    secret = Secret(kind="null", switches=(), strength=1, shape="bosses", recordings=1, seed=70002,
                    family="second")  # fmt: skip
    staged = stage(secret)
    device, travel, place = staged.on.device, staged.on.travels[0], staged.on.misplaced[0]
    shots = np.stack([
        device.scan(staged.on.solid, staged.on.facets, travel, np.random.default_rng(k),
                    specimen=k, misplaced=place)[0]
        for k in range(DRAWS)
    ])  # fmt: skip
    mean = np.where(np.isfinite(shots).all(0), shots.mean(0), np.nan)
    smooth = off_edges(expected(device, staged.on.solid, travel, place))
    poses = np.einsum("ij,njk->nik", place, travel.poses(device.way))
    stated = datasheet(device, travel, staged.noise_law)
    short = [{k: v for k, v in e.items() if k != "along_um"} for e in stated["effects"]]

    def departure(effects):
        file = tmp_path / "sensor.yaml"
        file.write_text(yaml.safe_dump({**stated, "effects": effects}))
        sheet = Datasheet.load(file)
        scene = Scene(staged.on.solid.vertices_mm, staged.on.solid.faces)
        view = View(scene, SensorModel(sheet), poses, travel.time_s)
        law = geometric_law(view, None)
        for effect in effects_of(sheet):
            law = effect.apply(law, view)
        rest = np.where(smooth & (law.reason == 0), mean - law.mean_mm, np.nan)
        n, m = (BLOCK * (k // BLOCK) for k in rest.shape)
        blocks = rest[:n, :m].reshape(n // BLOCK, BLOCK, m // BLOCK, BLOCK).mean(axis=(1, 3))
        return float(np.nanstd(blocks))

    assert departure(stated["effects"]) < 0.75 * departure(short)
