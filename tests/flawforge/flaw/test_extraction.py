"""A flaw that was made, scanned with noise and taken out has its shape within the noise."""

import numpy as np
import pytest
import trimesh
from scipy.interpolate import LinearNDInterpolator

from defects.flaw_bank import Relief
from defects.kinds.banked import spread
from defects.surface.surface import Surface as Skin
from flawforge.cli import main
from flawforge.flaw.extraction import extract
from flawforge.flaw.relief_denoising import denoise
from tests.support.flawed_scan import MADE, SHEET, around, plate, recorded


@pytest.mark.parametrize("kind", MADE)
def test_a_relief_is_the_flaw_within_the_noise(kind):
    part = plate()
    flawed, scan, recording = recorded(part, kind, **MADE[kind])
    found = extract(recording, part, SHEET, around(flawed), "one")
    relief = found.relief
    top = part.vertices_mm[:, 2].max()
    points = scan.laser.points_part_mm(scan.depth_ideal_mm, scan.poses_true).reshape(-1, 3)
    step = (relief.pitch_mm, relief.pitch_mm)
    skin = Skin.of(part.vertices_mm, part.faces)
    nodes = spread(skin, found.site, relief.height_mm.shape, step).skin_mm
    true = LinearNDInterpolator(points[:, :2], points[:, 2] - top)(nodes[:, :2])
    error = (relief.height_mm - true.reshape(relief.height_mm.shape))[relief.footprint]
    claimed, noise = found.denoised.sd_mm, found.noise.sd_mm
    assert 0.015 < noise < 0.018  # what the surface's figures say: 16.4 µm
    assert np.sqrt(np.mean(error**2)) < 1.1 * claimed < noise
    assert abs(error.mean()) < 0.1 * noise
    assert not relief.height_mm[~relief.footprint].any()
    flaw, size = flawed.flaws[0], relief.dimensions()
    net = flaw.removed_mm3 - flaw.added_mm3
    # The error of the relief's level, held to a tenth of the noise above, is no error of the sum.
    level = error.sum() * relief.pitch_mm**2
    allowed = 4 * claimed * np.sqrt(relief.footprint.sum()) * relief.pitch_mm**2
    found_net = size["removed_mm3"] - size["added_mm3"] + level
    assert found_net == pytest.approx(net, rel=0.02, abs=allowed)


def test_wiener_is_the_limit_without_missing_readings():
    """White noise on a periodic surface: the gain of each frequency is S / (S + N)."""
    rng = np.random.default_rng(2)
    n = 64
    x = 2 * np.pi * np.arange(n) / n
    surface = np.sin(3 * x)[:, None] * np.cos(2 * x)
    noisy = surface + rng.normal(0, 0.3, (n, n))
    everywhere = np.ones((n, n), bool)
    found = denoise(noisy, np.full((n, n), 0.09), (1.0, 1.0), everywhere)
    assert np.sqrt(np.mean((found.height_mm - surface) ** 2)) < 1.3 * found.sd_mm < 0.15
    holed = noisy.copy()
    holed[rng.uniform(size=(n, n)) < 0.3] = np.nan
    holed = denoise(holed, np.full((n, n), 0.09), (1.0, 1.0), everywhere)
    assert np.sqrt(np.mean((holed.height_mm - surface) ** 2)) < 2 * found.sd_mm


def test_the_command_writes_a_flaw_a_picture_and_its_origin(tmp_path, capsys):
    part = plate()
    flawed, _, recording = recorded(part, "dent", **MADE["dent"])
    recording.save(tmp_path / "a.h5")
    SHEET.save(tmp_path / "sensor.yaml")

    trimesh.Trimesh(part.vertices_mm, part.faces).export(tmp_path / "part.stl")
    x, y = flawed.flaws[0].position_mm[:2]
    words = [
        "flaw", "extract", str(tmp_path / "a.h5"), "--part", str(tmp_path / "part.stl"),
        "--sensor", str(tmp_path / "sensor.yaml"), "--out", str(tmp_path / "bank"),
        "--name", "one", "--region",
    ]  # fmt: skip
    assert main([*words, f"{x - 9},{y - 9},{x + 9},{y + 9}"]) == 0
    first = (tmp_path / "bank" / "one.npz").read_bytes()
    relief = Relief.load(tmp_path / "bank" / "one.npz")
    assert relief.facts["recording"] == "made"
    assert relief.facts["noise_sd_mm"] == pytest.approx(0.0164, rel=0.05)
    assert (tmp_path / "bank" / "one.png").stat().st_size > 10_000
    assert main([*words, f"{x - 9},{y - 9},{x + 9},{y + 9}"]) == 0
    assert (tmp_path / "bank" / "one.npz").read_bytes() == first
    capsys.readouterr()
    for region, said in (
        ("0:9", "--region: wrong form"),
        ("5,5,1,1", "--region: wrong form"),
        ("0:9,150:200", "--region lies outside the scan"),
        ("40,40,50,50", "--region holds no reading"),
        ("-19,13,-12,19", "--region holds no flaw above the noise"),
    ):
        assert main([*words, region]) == 2
        error = capsys.readouterr().err
        assert said in error
        assert error.count("\n") == 1
