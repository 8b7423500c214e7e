"""Fixtures that all tests share."""

import signal
from pathlib import Path

import pytest

from pipeline.batch.backend import one_thread_each

one_thread_each()  # before anything loads numpy: workers share the cores already
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # A job in the background of a shell ignores Ctrl-C, and so would all that the tests start.
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def shared_dir() -> Path:
    """Real meshes and recordings beside the checkout; tests that need them skip without."""
    path = Path(__file__).resolve().parents[1].parent / "shared"
    if not (path / "meshes").is_dir():
        pytest.skip("no shared/ folder with real meshes and recordings beside the checkout")
    return path


SMALL_SENSOR = """\
name: bench sensor
working_distance_mm: 100.0
z_range_mm: 40.0
x_fov_mm: 36.0
points_per_profile: 90
z_resolution_um: 2.0
repeatability_um: 1.0
profile_rate_hz: 1000.0
columns: {columns}
"""
SMALL_RECIPE = """\
name: small
seed: 3
sensor: sensor.yaml
surface: car_door
profiles: 60
scans: 2
splits: {train: 0.5, test: 0.5}
parts:
  - builtin: steel_plate
    name: plate
    specimens: 2
    parameters: {length_mm: 50, width_mm: 40, thickness_mm: 5, edge_radius_mm: 2}
flaws:
  dent: {number: 1, length_mm: {uniform: [8, 11]}, depth_mm: 0.5}
  pit: {number: 1}
motion: {length_mm: 26, yaw_deg: 15, aim_at_flaws: 1.0, aim_jitter: 0.3}
"""


def _small(folder: Path, columns: str) -> Path:
    from pipeline.batch.run import generate
    from pipeline.recipe import Recipe

    (folder / "sensor.yaml").write_text(SMALL_SENSOR.replace("{columns}", columns))
    (folder / "small.yaml").write_text(SMALL_RECIPE)
    generate(Recipe.load(folder / "small.yaml"), folder / "dataset")
    return folder / "dataset"


@pytest.fixture(scope="session")
def small_dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four scans of two flawed plates by a fan, as generated; not to be changed."""
    return _small(tmp_path_factory.mktemp("small"), "even_angle")


@pytest.fixture(scope="session")
def small_parallel_dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four scans of the same plates by a sensor with parallel columns."""
    return _small(tmp_path_factory.mktemp("parallel"), "even_x")
