"""What only the fitted recordings show is no mismatch of sensor or part."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.diagnose import diagnose
from sensors.view.covariates import COVARIATES
from tests.support.small_parts import VIEWS, datasheet, part, record

WITHHELD = ("line_bow", "lens_distortion", "form_error", "column_offset", "pixel_locking")


@pytest.mark.parametrize("everywhere", [True, False])
def test_a_wave_over_the_columns_must_be_in_every_recording(everywhere: bool) -> None:
    scene, sheet = part("bowl"), datasheet(100)
    wave = 0.003 * np.sin(np.linspace(0, 5 * np.pi, 100))
    made = []
    for k, view in enumerate(VIEWS):
        plain = record(scene, sheet, [], name=f"r{k}", seed=70 + k, profiles=72, pitch_mm=0.6,
                       **view)  # fmt: skip
        moved = replace(plain, depth_mm=plain.depth_mm + wave)
        made.append(moved if everywhere or k < 2 else plain)
    result = diagnose(made, scene.vertices_mm, scene.faces, sheet, withheld=WITHHELD)
    # it is seen in the fitted ones either way
    assert any(f.name == "free:x" for f in result.found)
    assert any(r.covariate == COVARIATES["x"].words for r in result.left) == everywhere


def test_a_smooth_map_of_one_scan_alone_is_no_mismatch() -> None:
    scene, sheet = part("bowl"), datasheet(100)
    made = []
    for k, view in enumerate(VIEWS):
        plain = record(scene, sheet, [], name=f"r{k}", seed=80 + k, profiles=72, pitch_mm=0.6,
                       **view)  # fmt: skip
        down, right = np.indices(plain.depth_mm.shape)
        hill = 0.004 * np.sin(3 * np.pi * down / 72) * np.sin(3 * np.pi * right / 100)
        made.append(replace(plain, depth_mm=plain.depth_mm + hill) if k == 0 else plain)
    result = diagnose(
        made, scene.vertices_mm, scene.faces, sheet,
        withheld=(*WITHHELD, "stage_vibration", "travel_ripple", "thermal_drift"),
    )  # fmt: skip
    assert any(f.name.startswith("free:scan:") for f in result.found)
    assert result.verdict == "match"
