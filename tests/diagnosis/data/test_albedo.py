"""Albedo patterns: sharp from blurred and speckled brightness, and only where there is one."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from diagnosis.data.albedo import find_albedo, with_brightness
from diagnosis.register.placement import Placement
from files.yaml_document import load_yaml
from sensors.casting.scene import Scene
from sensors.effects.reflectance_edge import ReflectanceEdge
from sensors.line.line_operator import centroid_bias_mm, gaussian_weights, sub_lines
from sensors.line.recorded_brightness import recorded_bias_mm
from sensors.model import SensorModel
from sensors.recording import Recording
from sensors.surface.reflectance import Picture, ReflectanceMap
from sensors.view.view import View
from tests.support.small_parts import datasheet, part, poses

PITCH_MM = 0.15
PERIOD_MM = 4.0
LINE_SD_MM = 0.07


def view_of(name: str, count: int = 160) -> View:
    return View(
        part(name), SensorModel(datasheet(160)), poses(count, pitch_mm=PITCH_MM),
        np.arange(count) / 200,
    )  # fmt: skip


def dark(part_mm: np.ndarray) -> np.ndarray:
    """Stripes along a slant of the part's plane."""
    along = 0.8 * part_mm[..., 0] + 0.6 * part_mm[..., 1]
    return np.mod(along / PERIOD_MM, 1.0) < 0.4


class Striped:
    """The stripes as a part's reflectance."""

    cell_mm = 0.0

    def at(self, part_mm: np.ndarray) -> np.ndarray:
        """Return 0.3 on the dark stripes, else 1."""
        return np.where(dark(part_mm), 0.3, 1.0)


def recorded(view: View, ratio: float, seed: int) -> np.ndarray:
    """Brightness with stripes, seen through a line a third of the pitch wide, and speckle."""
    seen = np.zeros(view.shape)
    for offset in np.linspace(-1, 1, 9) * PITCH_MM / 2:
        seen += np.where(dark(view.shifted(dy_mm=offset).part_mm), ratio, 1.0) / 9
    speckle = np.exp(0.4 * np.random.default_rng(seed).standard_normal(view.shape))
    return np.where(np.isfinite(view.depth_mm), 0.3 * seen * speckle, np.nan)


def bright(view: View, made: list[Recording]) -> tuple[Scene, list[Recording]]:
    """Give recordings that all lie where the view does the surface's part of their brightness."""
    still = Placement(
        shift=np.zeros(9), centre_mm=np.zeros(3), covariance=np.eye(9), poses=view.poses
    )
    names = [r.name for r in made]
    return with_brightness(
        made, dict.fromkeys(names, still), view.scene, view.datasheet,
        dict.fromkeys(names, view.laser),
    )  # fmt: skip


@pytest.mark.parametrize("name", ["wedge", "domes"])
def test_a_pattern_is_drawn_to_a_fraction_of_the_pitch(name: str) -> None:
    view = view_of(name)
    found = find_albedo([recorded(view, 0.3, seed) for seed in (1, 2)], [view, view])
    assert found is not None
    here = np.isfinite(view.depth_mm)
    truth = np.where(dark(view.part_mm), 0.3, 1.0)
    log = np.log(found.at(view.part_mm))[here]
    step = log[truth[here] == 1.0].mean() - log[truth[here] == 0.3].mean()
    assert abs(step + np.log(0.3)) < 0.15
    # two borders in each period: a mean error of a quarter of the readings' pitch on either
    pitch_mm = np.sqrt(PITCH_MM * np.median(np.diff(view.column_x_mm)))
    wrong = (log > 0.5 * (log.max() + log.min())) != (truth[here] == 1.0)
    assert wrong.mean() < 2 * 0.25 * pitch_mm / PERIOD_MM


def test_a_saved_pattern_is_a_recipes_reflectance(tmp_path: Path) -> None:
    view = view_of("wedge")
    found = find_albedo([recorded(view, 0.3, seed) for seed in (1, 2)], [view, view])
    assert found is not None
    found.save(tmp_path)
    lines = load_yaml(tmp_path / "reflectance.yaml").data["reflectance"]
    picture = Picture(**{**lines["picture"], "path": str(tmp_path / lines["picture"]["path"])})
    again = ReflectanceMap(picture=picture).at(view.part_mm)
    ratio = np.log(again / found.at(view.part_mm))
    # cells that lie across a border are read between their two levels
    assert (np.abs(ratio - np.median(ratio)) < 0.02).mean() > 0.9
    assert again.max() == 1.0


def test_no_pattern_is_found_where_brightness_follows_the_slope() -> None:
    view = view_of("wedge")
    shaded = np.where(view.slope_x > 0, 0.2, 1.0)
    speckle = np.exp(0.4 * np.random.default_rng(3).standard_normal(view.shape))
    assert find_albedo([0.3 * shaded * speckle], [view]) is None


def test_a_pattern_has_no_brightness_where_there_is_no_part() -> None:
    view = view_of("wedge")
    found = find_albedo([recorded(view, 0.3, 1)], [view])
    assert found is not None
    assert np.isnan(found.at(np.full((2, 3), np.nan))).all()


def test_a_pattern_predicts_the_bias_better_than_the_brightness_it_is_drawn_from() -> None:
    view = view_of("wedge")
    true = View(
        view.scene.finished(Striped()), view.sensor, view.poses, view.time_s, laser=view.laser
    )
    truth = centroid_bias_mm(true, LINE_SD_MM)
    made = [
        Recording(
            name=name, depth_mm=view.depth_mm, poses=view.poses, time_s=view.time_s,
            intensity=recorded(view, 0.3, seed),
        )
        for seed, name in enumerate("abc")
    ]  # fmt: skip
    scene, kept = bright(view, made)

    def told(part: Scene) -> float:
        seen = View(
            part, view.sensor, view.poses, view.time_s, laser=view.laser,
            intensity=kept[0].intensity,
        )  # fmt: skip
        left = centroid_bias_mm(seen, LINE_SD_MM) - truth
        return float(1 - np.square(left).sum() / np.square(truth).sum())

    assert told(scene) > 0.5
    assert told(scene) > told(view.scene) + 0.2


def test_without_brightness_in_each_recording_the_part_stays_as_it_is() -> None:
    view = view_of("wedge", 20)
    made = Recording(
        name="a", depth_mm=view.depth_mm, poses=view.poses, time_s=view.time_s
    )
    scene, kept = bright(view, [made])
    assert scene is view.scene
    assert kept == [made]


def test_a_line_narrower_than_the_pattern_s_cells_reads_the_border_by_its_brightness() -> None:
    """Speckle is taken off both levels; between them the line lies on a border."""
    sd, view = 0.03 * PITCH_MM, view_of("wedge")
    part = view.scene.finished(Striped())
    true = View(part, view.sensor, view.poses, view.time_s, laser=view.laser)
    seen = np.zeros(view.shape)
    offsets = sub_lines(sd)
    weights = gaussian_weights(offsets, sd)
    for offset, weight in zip(offsets, weights, strict=True):
        seen += weight / sum(weights) * Striped().at(view.shifted(dy_mm=float(offset)).part_mm)
    truth = centroid_bias_mm(true, sd)
    made, rng = [], np.random.default_rng(5)
    for name in "abc":
        speckled = 0.3 * seen * np.exp(0.08 * rng.standard_normal(view.shape))
        made.append(Recording(
            name=name, depth_mm=view.depth_mm, poses=view.poses, time_s=view.time_s,
            intensity=np.where(np.isfinite(view.depth_mm), speckled, np.nan),
        ))  # fmt: skip
    scene, kept = bright(view, made)

    def told(intensity: np.ndarray | None, bias: Callable[[View, float], np.ndarray]) -> float:
        looked = View(
            scene, view.sensor, view.poses, view.time_s, laser=view.laser, intensity=intensity
        )
        left = bias(looked, sd) - truth
        return float(1 - np.square(left).sum() / np.square(truth).sum())

    by_border = told(kept[0].intensity, recorded_bias_mm)
    assert by_border > 0.6
    assert by_border > told(None, centroid_bias_mm) + 0.4
    assert by_border > told(made[0].intensity, recorded_bias_mm) + 0.4
    law = ReflectanceEdge(line_sd_um=1e3 * sd)
    looked = View(scene, view.sensor, view.poses, view.time_s, laser=view.laser,
                  intensity=kept[0].intensity)  # fmt: skip
    hit = np.isfinite(view.depth_mm)
    assert np.allclose(law.signature(looked)[hit], recorded_bias_mm(looked, sd)[hit], atol=1e-9)
