"""`flawforge import` as a user types it."""

from pathlib import Path

import numpy as np
import pytest

from flawforge.cli import main
from sensors.datasheet import Datasheet
from sensors.recording import Recording

PITCH = ["--pitch-x-mm", "0.1", "--pitch-y-mm", "0.2"]


@pytest.fixture
def scan(tmp_path: Path) -> Path:
    rng = np.random.default_rng(1)
    z = np.cumsum(rng.normal(0.0, 0.01, (30, 40)), axis=1)
    z[5] = z[4]
    z[7, 8] = np.nan
    np.save(tmp_path / "scan.npy", z)
    return tmp_path / "scan.npy"


def test_import_writes_recording_and_sensor(
    scan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "made" / "rec.h5"
    assert main(["import", str(scan), "--as", str(target), *PITCH, "--name", "line"]) == 0
    recording = Recording.load(target)
    sensor = Datasheet.load(tmp_path / "made" / "rec-sensor.yaml")
    z = np.delete(np.load(scan), 5, axis=0)
    wanted = (sensor.working_distance_mm - z).astype(np.float32)
    np.testing.assert_array_equal(recording.depth_mm.astype(np.float32), wanted)
    assert recording.name == "line"
    assert sensor.columns == "even_x"
    said = capsys.readouterr().out
    assert "29 profiles × 40 points, pitch 0.1 × 0.2 mm, 0.09 % missing" in said
    assert "repeated rows dropped: 1" in said
    assert "assumed: working distance" in said
    assert "rec-sensor.yaml" in said


def test_keep_repeated_and_what_is_given(
    scan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--keep-repeated", "--working-distance-mm", "80", "--rate-hz", "50", "--unit", "um"]
    words += ["--sensor-out", str(tmp_path / "other.yaml")]
    assert main(["import", str(scan), "--as", str(tmp_path / "r.h5"), *PITCH, *words]) == 0
    recording = Recording.load(tmp_path / "r.h5")
    assert recording.depth_mm.shape == (30, 40)
    assert recording.time_s[1] == 0.02
    assert Datasheet.load(tmp_path / "other.yaml").working_distance_mm == 80.0
    said = capsys.readouterr().out
    assert "repeated rows kept: 1" in said
    assert "assumed" not in said


def test_the_optical_axis_is_kept_in_the_sensor(
    scan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["import", str(scan), "--as", str(tmp_path / "r.h5"), *PITCH, "--optical-axis-x-mm"]
    assert main([*words, "-1.5"]) == 0
    assert Datasheet.load(tmp_path / "r-sensor.yaml").optical_axis_x_mm == -1.5
    capsys.readouterr()
    assert main([*words, "nan"]) == 2
    assert "--optical-axis-x-mm isn't a place" in capsys.readouterr().err


def test_what_was_imported_can_be_measured(scan: Path, tmp_path: Path) -> None:
    """The roughness command reads the recording with the pitch that was given."""
    from sensors.surface.topography import load_topography

    main(["import", str(scan), "--as", str(tmp_path / "r.h5"), *PITCH])
    topography = load_topography(tmp_path / "r.h5")
    assert topography.pitch_x_mm == pytest.approx(0.1)
    assert topography.pitch_y_mm == pytest.approx(0.2)


def test_roughness_reads_what_import_reads(tmp_path: Path, shared_dir: Path) -> None:
    """A file and its recording have the same pitch and heights, depths being heights' negatives."""
    from sensors.surface.topography import load_topography

    for name in ("sick/OCR_3D_image_34.json", "roughness/dektak-1.csv", "roughness/sur-2.sur"):
        path = shared_dir / "real" / name
        main(["import", str(path), "--as", str(tmp_path / "r.h5")])
        file, recording = load_topography(path), load_topography(tmp_path / "r.h5")
        assert file.pitch_x_mm == pytest.approx(recording.pitch_x_mm, rel=1e-4)
        assert file.pitch_y_mm == pytest.approx(recording.pitch_y_mm, rel=1e-4)
        distance = float(Datasheet.load(tmp_path / "r-sensor.yaml").working_distance_mm)
        np.testing.assert_allclose(
            distance - recording.readings_mm, file.readings_mm, rtol=0, atol=1e-7 * distance
        )


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "give --pitch-x-mm"),
        (["--pitch-x-mm", "-1"], "--pitch-x-mm is not above 0"),
        ([*PITCH, "--unit", "ell"], "unknown unit"),
        ([*PITCH, "--depth"], "--height"),
        ([*PITCH, "--working-distance-mm", "0.001"], "--working-distance-mm"),
        ([*PITCH, "--unit", "um", "--z-step-mm", "1"], "give one"),
    ],
)
def test_bad_words_write_nothing(
    scan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    assert main(["import", str(scan), "--as", str(tmp_path / "r.h5"), *words]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert sorted(p.name for p in tmp_path.iterdir()) == ["scan.npy"]


def test_bad_targets_and_files(
    scan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "folder.h5").mkdir()
    sick = tmp_path / "cut.json"
    sick.write_text('[{"class": "Image", "data"')
    target = str(tmp_path / "r.h5")
    for words, said in (
        ([str(scan), "--as", str(tmp_path / "r.npy"), *PITCH], "isn't a .h5 file"),
        ([str(scan), "--as", str(tmp_path / "folder.h5"), *PITCH], "is a folder"),
        ([str(sick), "--as", target], "isn't JSON, or cut short"),
        ([str(sick), "--as", target, "--z-step-mm", "1"], "requires a file of counts"),
        ([str(tmp_path / "scan.foo"), "--as", target], "unknown format"),
        ([str(scan), str(scan), "--as", target, *PITCH], "isn't a single profile"),
    ):
        assert main(["import", *words]) == 2, words
        assert said in capsys.readouterr().err


def test_help_explains(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["import", "--help"]) == 0
    said = capsys.readouterr().out
    assert "example" in said
    assert "resamples, averages and fills nothing" in said


def test_real_groove(
    shared_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = shared_dir / "real" / "sick" / "StripGroove_image_9.json"
    assert main(["import", str(path), "--as", str(tmp_path / "g.h5")]) == 0
    said = capsys.readouterr().out
    assert "repeated rows dropped: 79" in said
    assert "471 profiles × 648 points, pitch 0.101185 × 0.1 mm" in said
    assert "with intensity" in said
    recording = Recording.load(tmp_path / "g.h5")
    assert recording.intensity is not None
    steps = np.diff(recording.poses[:, 1, 3]) / 0.1
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-3)  # gaps where rows were dropped
    assert np.rint(steps).sum() == 549 - (np.rint(recording.poses[0, 1, 3] / 0.1))
