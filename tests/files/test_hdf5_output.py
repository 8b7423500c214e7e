"""A fault of the disk in HDF5's own writes is an OSError, and Python ends in good order."""

import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np

from files.hdf5_output import created

HOME = Path(__file__).resolve().parents[2]
SCRIPT = """
import resource, sys
from pathlib import Path
import numpy as np
from files.hdf5_output import created

def write(path):
    with created(path) as file:
        data = file.create_dataset("a", shape=(3, 60, 90), chunks=(1, 60, 90), dtype="u2")
        for row in range(3):
            data[row] = np.random.default_rng(row).integers(0, 60000, (60, 90))
            data.flush()

whole = Path("whole.h5")
write(whole)
size, faults = whole.stat().st_size, 0
for share in range(16):  # every write beyond a length fails, also while Python goes down
    resource.setrlimit(resource.RLIMIT_FSIZE, (size * share // 16, resource.RLIM_INFINITY))
    try:
        write(Path("torn.h5"))
    except OSError as error:
        assert error.errno and error.filename == "torn.h5", error
        faults += 1
    assert not Path("torn.h5").exists()
sys.exit(10 + faults)
"""


def test_faults_are_raised_and_nothing_crashes(tmp_path):
    run = subprocess.run(
        [sys.executable, "-c", SCRIPT], cwd=tmp_path, env={"PYTHONPATH": str(HOME)},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (run.returncode, run.stderr) == (26, "")


def test_what_is_written_is_read_back(tmp_path):
    values = np.random.default_rng(0).normal(size=(50, 70))
    with created(tmp_path / "a.h5") as file:
        file.create_dataset("a", data=values, compression="gzip", chunks=(7, 70))
        file.attrs["name"] = "x"
    with h5py.File(tmp_path / "a.h5") as file:
        np.testing.assert_array_equal(file["a"][:], values)
        assert file.attrs["name"] == "x"
    assert [path.name for path in tmp_path.iterdir()] == ["a.h5"]
