"""A flaw out of a noisy scan, planted on other parts, keeps its shape there."""

from dataclasses import replace

import numpy as np
import pytest

from defects.carving.block import Block
from defects.flaw_bank import FlawBank, Relief
from defects.kinds.banked import Banked
from defects.surface.surface import SiteError
from flawforge.flaw.extraction import extract
from tests.support.flawed_scan import MADE, SHEET, around, plate, recorded
from tests.support.reliefs import hollow_and_rim


@pytest.fixture(scope="module")
def taken():
    """The dent of a noisy scan."""
    part = plate()
    flawed, _, recording = recorded(part, "dent", **MADE["dent"])
    return extract(recording, part, SHEET, around(flawed), "one").relief


@pytest.mark.parametrize("name", ["plate", "cylinder", "bent"])
def test_a_relief_planted_again_is_itself(name, solids, surfaces, taken):
    """On other parts: each node stands where the relief says, along the local normal."""
    relief = taken
    surface, solid = surfaces[name], solids[name]
    kind = Banked(
        which=0.5, scale=0.5, height_ratio=2.0, mirror=0, bend_deg=0.0,
        bank=FlawBank(reliefs=(relief,)),
    )  # fmt: skip
    wanted = np.abs(surface.normals[:, 2]) < 0.5 if name == "cylinder" else (
        surface.normals[:, 2] > 0.99
    )
    block = Block(solid.vertices_mm, solid.faces)
    for site in surface.random_sites(np.random.default_rng(1), 60, wanted.astype(float)):
        try:
            cutter = kind.cutter(surface, site, np.random.default_rng(0))
            change = block.trial(cutter)
            break
        except (ValueError, RuntimeError):
            continue
    carved = block.carve([cutter], [change])
    made = carved.vertices_mm[np.unique(carved.faces[carved.instance == 1])]
    onto, normals, _ = surface.project(made)
    height = np.sum((made - onto) * normals, axis=1)
    size = relief.dimensions()
    assert -height.min() == pytest.approx(size["depth_mm"], rel=0.02)
    assert height.max() == pytest.approx(size["height_mm"], rel=0.05)
    scaled = 0.5**2  # lengths by a half each way, heights as they were
    net = (size["removed_mm3"] - size["added_mm3"]) * scaled
    assert change.removed_mm3 - change.added_mm3 == pytest.approx(net, rel=0.02)


def test_mirror_and_bend_keep_the_volume(solids, surfaces):
    bank = hollow_and_rim()
    surface, solid = surfaces["plate"], solids["plate"]
    block = Block(solid.vertices_mm, solid.faces)
    (site,) = surface.random_sites(
        np.random.default_rng(3), 1, (surface.normals[:, 2] > 0.99).astype(float)
    )
    plain = Banked(which=0, scale=1.0, height_ratio=1.0, mirror=0, bend_deg=0.0, bank=bank)
    first = block.trial(plain.cutter(surface, site, np.random.default_rng(0)))
    for other in (replace(plain, mirror=1), replace(plain, bend_deg=30.0)):
        change = block.trial(other.cutter(surface, site, np.random.default_rng(0)))
        assert change.removed_mm3 == pytest.approx(first.removed_mm3, rel=0.02)


def test_a_file_gives_the_relief_back_and_anything_else_is_refused(tmp_path):
    relief = hollow_and_rim().reliefs[0]
    relief.save(tmp_path / "a.npz")
    again = Relief.load(tmp_path / "a.npz")
    np.testing.assert_array_equal(again.height_mm, relief.height_mm)
    np.testing.assert_array_equal(again.mask, relief.mask)
    assert (again.name, again.pitch_mm) == ("hollow", 0.1)
    data = (tmp_path / "a.npz").read_bytes()
    for wrong in (b"", b"PK", data[: len(data) // 2], b"x" * 100):
        (tmp_path / "a.npz").write_bytes(wrong)
        with pytest.raises(ValueError, match=r"a\.npz: isn't a relief of a flaw"):
            FlawBank.load([tmp_path / "a.npz"])
    with pytest.raises(ValueError, match="two nodes from the rim"):
        replace(relief, height_mm=np.ones_like(relief.height_mm))


def test_a_bank_is_drawn_from_evenly_and_none_is_refused(surfaces):
    one = hollow_and_rim().reliefs[0]
    bank = FlawBank(reliefs=tuple(replace(one, name=str(k)) for k in range(4)))
    rng = np.random.default_rng(1)
    drawn = [Banked.draw(Banked.typical(), rng) for _ in range(400)]
    counts = np.bincount([int(bank.at(flaw.which).name) for flaw in drawn])
    assert (np.abs(counts - 100) < 35).all()
    assert bank.at(1.0).name == "3"
    (site,) = surfaces["plate"].random_sites(rng, 1)
    with pytest.raises(SiteError, match="no bank"):
        drawn[0].cutter(surfaces["plate"], site, rng)
