"""The noise of a part against a plate's: the least change of all recordings counts."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.claims.plate_noise import level_change, plates_doubt
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.predict.albedo_borders import albedo_borders
from diagnosis.predict.cameras import with_sheet
from sensors.effects.pixel_locking import PixelLocking
from tests.support.effect_case import bench_workspace


@pytest.fixture(scope="module")
def ws() -> Workspace:
    return bench_workspace("valley")


def test_the_level_of_the_noise_is_what_every_recording_bears_out(ws: Workspace) -> None:
    plain = ws.predict(Model())

    def rougher(factors: tuple[float, float]) -> Workspace:
        patches = tuple(
            replace(
                p, depth_mm=q.mean_mm + factors[p.recording] * (p.depth_mm - q.mean_mm)
            )
            for p, q in zip(ws.patches, plain, strict=True)
        )
        return replace(ws, patches=patches)

    def told(factors: tuple[float, float]) -> float:
        return level_change(rougher(factors), Model(), ws.noise.sd_mm).log

    assert told((1.5, 1.5)) == pytest.approx(np.log(1.5), abs=0.05)
    assert told((1.5, 1.2)) == pytest.approx(np.log(1.2), abs=0.05)
    assert abs(told((1.5, 1.0))) < 0.05
    assert told((1.5, 0.7)) == 0.0


def test_noise_that_goes_with_the_line_is_no_rougher_finish(ws: Workspace) -> None:
    """Light that falls off towards the ends was reported as a rougher surface."""
    patches = []
    for p, q in zip(ws.patches, ws.predict(Model()), strict=True):
        ends = np.abs(np.linspace(-1, 1, p.shape[1])) > 0.4
        louder = np.where(ends, 1.4, 1.0)
        patches.append(replace(p, depth_mm=q.mean_mm + louder * (p.depth_mm - q.mean_mm)))
    dim = replace(ws, patches=tuple(patches))
    assert level_change(dim, Model(), ws.noise.sd_mm).log > 0.15
    assert abs(level_change(dim, Model(), ws.noise.sd_mm, {"x"}).log) < 0.07


def test_a_cause_of_noise_that_follows_the_rows_makes_a_plate_no_measure_of_the_part() -> None:
    """A plate stands within one row or two of the camera; the part reaches over many."""
    view = bench_workspace("valley").patches[0].view
    assert plates_doubt(Model(), view) == 0.0
    locked = Model(effects=(PixelLocking(amplitude_px=0.02),))
    # a sinusoid's slope is 2π times its amplitude: that much, each way
    assert plates_doubt(locked, view) == pytest.approx(4 * np.pi * 0.02)


def test_borders_of_a_print_say_nothing_of_the_finish(ws: Workspace) -> None:
    # relief of light at a print's borders, which no model explains here
    patches = []
    for p in ws.patches:
        bright = np.where(np.arange(p.shape[0])[:, None] // 24 % 2, 60.0, 200.0)
        view = p.view.posed(p.view.poses)
        view.intensity = np.broadcast_to(bright, p.shape).copy()
        border = albedo_borders(view)
        relief = np.where(border, 2.5 * ws.noise.sd_mm, 0.0)
        patches.append(replace(p, view=view, depth_mm=p.depth_mm + relief))
    printed = replace(ws, patches=tuple(patches))
    assert abs(level_change(printed, Model(), ws.noise.sd_mm).log) < 0.08


def test_noise_that_follows_rows_is_compared_by_the_rows_that_were_fitted(ws: Workspace) -> None:
    """A file that states no rows ended a diagnosis that had found some."""
    patches = tuple(
        replace(p, view=with_sheet(p.view, replace(p.view.datasheet, camera_rows=None)))
        for p in ws.patches
    )
    locked = Model(effects=(PixelLocking(amplitude_px=0.001, rows=1200.0),))
    assert abs(level_change(replace(ws, patches=patches), locked, ws.noise.sd_mm).log) < 0.08
