"""What a command loads before it does anything: `--help` next to nothing, a batch no statistics."""

import subprocess
import sys
from pathlib import Path

import pytest

HOME = Path(__file__).resolve().parents[2]
FOR_LATER = ("scipy.signal", "scipy.stats", "scipy.optimize", "scipy.interpolate", "pandas",
             "pyarrow", "matplotlib", "trimesh", "networkx", "PIL", "tqdm")  # fmt: skip


def loaded_by(code: str) -> set[str]:
    run = subprocess.run(
        [sys.executable, "-c", f"{code}\nimport sys\nprint(*sys.modules)"],
        cwd=HOME,
        capture_output=True,
        text=True,
        check=True,
    )
    return set(run.stdout.splitlines()[-1].split())


def test_help_loads_no_library():
    code = "from flawforge.cli import main\nmain([])"
    assert not loaded_by(code) & {"numpy", "numba", "pydantic", "joblib", "h5py", *FOR_LATER}


@pytest.mark.parametrize(
    "module", ["pipeline.batch.run", "pipeline.batch.cluster", "sensors.effects"]
)
def test_a_batch_loads_what_scans_need(module):
    loaded = loaded_by(f"import {module}")
    assert module in loaded
    assert not loaded & set(FOR_LATER)
