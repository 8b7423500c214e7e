"""Filters of the firmware are told from other finishes by the noise's spectrum."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.claims.firmware import onboard_filter_of
from diagnosis.noise.noise_model import calibrate
from sensors.effects.onboard_filter import OnboardFilter
from sensors.law import geometric_law
from sensors.surface.surface import Surface

PITCH = (0.1, 0.1)
SHAPE = (80, 140)
NONE = OnboardFilter.none()


@pytest.fixture(scope="module")
def claimed(view_of_plate):
    surface = Surface(name="rough", rpm_mm=0.015, rvm_mm=0.015, pc_per_mm=4.0)
    return surface, view_of_plate


@pytest.fixture(scope="module")
def view_of_plate():
    import trimesh

    from sensors.casting.scene import Scene
    from sensors.datasheet import Datasheet
    from sensors.model import SensorModel
    from sensors.view.view import View

    plate = trimesh.creation.box((40.0, 40.0, 5.0))
    sheet = Datasheet(
        name="test", working_distance_mm=100.0, z_range_mm=60.0, x_fov_mm=14.0,
        points_per_profile=141, z_resolution_um=1.0, profile_rate_hz=500.0, columns="even_x",
    )  # fmt: skip
    poses = np.tile(np.eye(4), (81, 1, 1))
    poses[:, :3, :3] = np.diag([-1.0, 1.0, -1.0])
    poses[:, 1, 3] = np.linspace(-4.0, 4.0, 81)
    poses[:, 2, 3] = 102.5
    return View(Scene(plate.vertices, plate.faces), SensorModel(sheet), poses, np.arange(81) / 500)


def recorded(claimed, firmware, *, amplitude=1.0, peaks=1.0, seed=1):
    """Noise of two flats of a surface, through the firmware."""
    surface, view = claimed
    field = geometric_law(view, surface).speckle
    field = replace(
        field, amplitude_mm=field.amplitude_mm * amplitude,
        cell_x_mm=field.cell_x_mm / peaks, cell_y_mm=field.cell_y_mm / peaks,
    )  # fmt: skip
    fields = []
    for number in range(2):
        rng = np.random.default_rng([seed, number])
        heights = field.sample(PITCH[0] * np.arange(SHAPE[1]), PITCH[1] * np.arange(SHAPE[0]), rng)
        readings = heights + 3e-4 * rng.standard_normal(SHAPE)
        fields.append(firmware.filtered(np.rint(readings / 1e-3) * 1e-3))
    return calibrate(
        fields, [np.ones(SHAPE, dtype=bool)] * 2, pitch_mm=PITCH, missing_share=0.0,
        from_reference=False,
    )  # fmt: skip


@pytest.mark.parametrize(
    "windows",
    [
        {"median_points": 3, "median_profiles": 3, "mean_points": 5},
        {"mean_points": 5},
        {"mean_profiles": 3, "mean_points": 3},
        {"median_points": 5},
        {"median_points": 3, "median_profiles": 3},
        {"mean_profiles": 7},
    ],
)
def test_a_filter_is_found_with_its_windows(claimed, windows):
    firmware = NONE.with_parameters(windows)
    noise = recorded(claimed, firmware, amplitude=0.9)
    assert onboard_filter_of(noise, *claimed) == firmware


@pytest.mark.parametrize("amplitude", [0.2, 0.8])
@pytest.mark.parametrize("peaks", [0.3, 1.0, 2.0])
def test_another_finish_is_no_filter(claimed, amplitude, peaks):
    noise = recorded(claimed, NONE, amplitude=amplitude, peaks=peaks)
    assert onboard_filter_of(noise, *claimed) is None
