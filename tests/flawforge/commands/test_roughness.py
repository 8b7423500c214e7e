"""`flawforge roughness`: what it prints and writes, from each kind of file, and what it refuses."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from PIL import Image

from flawforge.cli import main
from sensors.recording import Recording
from sensors.surface.surface import Surface
from sensors.surface.topography import load_topography, resolution_of

PITCH = ["--pitch-x-mm", "0.05", "--pitch-y-mm", "0.2"]


@pytest.fixture
def grid() -> np.ndarray:
    """Readings of a rough tilted plate, rounded to 4 µm, with a hole."""
    rng = np.random.default_rng(1)
    z = rng.normal(0.0, 0.02, (40, 300)) + 0.001 * np.arange(300)
    z = np.rint(z / 0.004) * 0.004
    z[5, 30:40] = np.nan
    return z


def test_array_gives_table_surface_and_picture(
    tmp_path: Path, grid: np.ndarray, capsys: pytest.CaptureFixture[str]
) -> None:
    np.save(tmp_path / "plate.npy", grid)
    out = tmp_path / "out"
    words = ["roughness", str(tmp_path / "plate.npy"), *PITCH, "--no-noise", "--out", str(out)]
    assert main(words) == 0
    printed = capsys.readouterr().out
    assert "40 profiles × 300 points" in printed
    assert "resolution 4 µm" in printed
    surface = Surface.load(out / "surface.yaml")
    assert surface.rq_mm == pytest.approx(0.02, rel=0.03)
    assert surface.ra_mm == pytest.approx(0.02 * np.sqrt(2 / np.pi), rel=0.03)
    assert (surface.points_per_profile, surface.profiles) == (300, 40)
    assert surface.calibration is None
    assert (out / "roughness.png").stat().st_size > 10_000
    each = np.loadtxt(out / "roughness.csv", delimiter=",", skiprows=1)
    assert each.shape == (40, 7)
    assert each[:, 1].mean() == pytest.approx(surface.rq_mm, rel=1e-5)


def test_region_and_cutoff_are_used(tmp_path: Path, grid: np.ndarray) -> None:
    grid[:, 200:] += np.sin(np.arange(100) / 15.0)  # form that neither line nor region keeps
    np.save(tmp_path / "plate.npy", grid)

    def rq(*more: str) -> float:
        words = ["roughness", str(tmp_path / "plate.npy"), *PITCH, "--no-noise"]
        assert main([*words, *more, "--out", str(tmp_path / "out")]) == 0
        value = Surface.load(tmp_path / "out" / "surface.yaml").rq_mm
        assert value is not None
        return value

    assert rq() > 0.1
    assert rq("--region", "0:40,:200") == pytest.approx(0.02, rel=0.05)
    assert rq("--cutoff-mm", "0.8") < 0.05


def test_recording_with_repeated_profiles(tmp_path: Path, grid: np.ndarray) -> None:
    depth = 400.0 + np.repeat(grid, 2, axis=0)
    poses = np.tile(np.eye(4), (80, 1, 1))
    poses[:, 1, 3] = np.arange(80) * 0.1
    recording = Recording(
        name="plate",
        depth_mm=depth,
        poses=poses,
        time_s=np.arange(80) * 0.01,
        x_mm=np.arange(300) * 0.05,
    )
    recording.save(tmp_path / "plate.h5")
    scan = load_topography(tmp_path / "plate.h5")
    assert scan.repeated == 40
    assert scan.readings_mm.shape == (40, 300)
    assert scan.pitch_x_mm == pytest.approx(0.05)
    assert scan.pitch_y_mm == pytest.approx(0.1)
    assert resolution_of(scan.readings_mm) == pytest.approx(0.004, rel=0.02)
    with h5py.File(tmp_path / "plate.h5", "a") as file:
        del file["x"]
    with pytest.raises(ValueError, match="pitch-x-mm"):
        load_topography(tmp_path / "plate.h5")


def test_profile_of_two_columns_gives_pitch_and_units(tmp_path: Path) -> None:
    x = np.arange(400) * 0.0015
    z_um = 5.0 * np.sin(2 * np.pi * x / 0.1)
    path = tmp_path / "profile.csv"
    np.savetxt(path, np.stack((x, z_um), axis=1), delimiter=",", header="x_mm,z_um")
    scan = load_topography(path)
    assert scan.pitch_x_mm == pytest.approx(0.0015)
    assert scan.readings_mm.max() == pytest.approx(0.005, rel=1e-3)


def test_grids_in_csv_and_tiff_with_their_unit(tmp_path: Path) -> None:
    z = np.random.default_rng(2).normal(size=(20, 30)).astype(np.float32)
    np.savetxt(tmp_path / "a.csv", z, delimiter=";")
    Image.fromarray(z).save(tmp_path / "a.tiff")
    for name in ("a.csv", "a.tiff"):
        scan = load_topography(tmp_path / name, unit="um", pitch_x_mm=0.1)
        np.testing.assert_allclose(scan.readings_mm, z / 1000.0, rtol=1e-6)
        assert scan.pitch_y_mm == 0.1


def test_figures_in_a_yaml_are_solved(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text("name: mine\nrpm_mm: 0.02\nrvm_mm: 0.03\npc_per_mm: 5.0\n")
    out = tmp_path / "out"
    assert main(["roughness", str(path), *PITCH, "--out", str(out)]) == 0
    assert "largest error" in capsys.readouterr().out
    surface = Surface.load(out / "surface.yaml")
    assert surface.is_calibrated
    assert surface.pitch_x_mm == 0.05
    assert surface.calibration is not None
    assert surface.calibration.worst_error < 0.01


@pytest.mark.parametrize(
    ("name", "content", "more", "said"),
    [
        ("no.npy", None, [], "no such file"),
        ("a.npy", b"nothing", PITCH, "isn't an array"),
        ("a.csv", b"1,2\n3,x\n", PITCH, "a.csv:2: isn't a row of numbers"),
        ("a.csv", b"", PITCH, "is empty"),
        ("a.csv", b"1,2,3\n4,5\n", PITCH, "different lengths"),
        ("a.tiff", b"II*\0", PITCH, "isn't a TIFF"),
        ("a.foo", b"1", PITCH, "allowed: .h5"),
        ("a.h5", b"1", PITCH, "can't be read"),
    ],
)
def test_bad_files_give_one_line_and_exit_code_2(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    name: str,
    content: bytes | None,
    more: list[str],
    said: str,
) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    words = ["roughness", str(tmp_path / name), *more, "--out", str(tmp_path / "out")]
    assert main(words) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ([], "pitch-x-mm"),
        ([*PITCH, "--region", "0:50,0:10"], "outside"),
        ([*PITCH, "--region", "all"], "--region: wrong form"),
        ([*PITCH, "--cutoff-mm", "-1"], "above 0"),
        ([*PITCH, "--unit", "ell"], "unknown unit"),
        (["--pitch-x-mm", "nan"], "is not a length"),
    ],
)
def test_bad_words_give_one_line_and_exit_code_2(
    tmp_path: Path,
    grid: np.ndarray,
    capsys: pytest.CaptureFixture[str],
    more: list[str],
    said: str,
) -> None:
    np.save(tmp_path / "a.npy", grid)
    assert main(["roughness", str(tmp_path / "a.npy"), *more, "--out", str(tmp_path / "o")]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not (tmp_path / "o").exists()


def test_resolution_of_what_is_not_rounded_is_zero() -> None:
    assert resolution_of(np.random.default_rng(3).normal(size=(50, 50))) == 0.0
    coarse = np.rint(np.random.default_rng(4).normal(size=(50, 50)) / 0.1) * 0.1
    assert resolution_of(coarse + 400.0) == pytest.approx(0.1, rel=1e-6)


def test_a_measured_speckle_is_written_and_simulated_with_its_correlation(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rng = np.random.default_rng(3)
    white = rng.normal(0.0, 0.02, (121, 200))
    readings = np.rint((white[1:] - 0.6 * white[:-1]) / 0.001) * 0.001
    np.save(tmp_path / "plate.npy", readings)
    words = ["roughness", str(tmp_path / "plate.npy"), *PITCH, "--speckle", "measured"]
    assert main([*words, "--out", str(tmp_path / "out")]) == 0
    assert "error %" in capsys.readouterr().out
    surface = Surface.load(tmp_path / "out" / "surface.yaml")
    assert surface.calibration is None
    assert surface.is_calibrated  # nothing is solved for it
    assert surface.ready() == surface
    assert main(["roughness", str(tmp_path / "out" / "surface.yaml")]) == 2
    assert "'measured' is the file's noise" in capsys.readouterr().err
    rho = surface.field().correlation_at(np.zeros(1), 0.2 * np.arange(2))[:, 0]
    assert rho == pytest.approx([1.0, -0.6 / 1.36], abs=0.03)


@pytest.mark.parametrize("slope", [-0.5, 0.5])
def test_the_noise_of_a_tilted_plate_is_divided_by_what_the_file_lists(
    tmp_path: Path, slope: float
) -> None:
    exponent, lean, n = 0.5, 0.4, 60
    y = 0.2 * np.arange(n)
    gain = (1 + slope**2) ** (exponent / 2) * np.exp(lean * slope)
    noise = gain * np.random.default_rng(5).normal(0.0, 0.02, (n, 200))
    poses = np.repeat(np.eye(4)[None], n, axis=0)
    poses[:, 1, 3] = y
    Recording(
        name="plate", depth_mm=100.0 + slope * y[:, None] + noise, poses=poses,
        time_s=np.arange(n) / 100.0, x_mm=np.linspace(-10, 10, 200),
    ).save(tmp_path / "plate.h5")  # fmt: skip
    (tmp_path / "sensor.yaml").write_text(
        "name: s\nworking_distance_mm: 100\nz_range_mm: 40\nx_fov_mm: 20\n"
        "points_per_profile: 200\nz_resolution_um: 1\nprofile_rate_hz: 100\n"
        "travel_speed_mm_s: 20\n"
        f"effects: [{{name: incidence_noise, exponent: {exponent}, lean: {lean}}}]\n"
    )
    words = ["roughness", str(tmp_path / "plate.h5"), "--sensor", str(tmp_path / "sensor.yaml")]
    assert main([*words, "--no-noise", "--out", str(tmp_path / "out")]) == 0
    rq = Surface.load(tmp_path / "out" / "surface.yaml").rq_mm
    assert rq == pytest.approx(0.02, rel=0.02)
