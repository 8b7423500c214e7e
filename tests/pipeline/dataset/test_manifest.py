"""The tables' columns are Arrow's own, made without pandas."""

import subprocess
import sys
import tempfile
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.dataset.manifest import write_manifest

HOME = Path(__file__).resolve().parents[3]
COLUMNS = {  # of the manifest's table, one of each type
    "sensor": (pa.string(), st.text()),
    "aimed_at_instance": (pa.int64(), st.integers(-(2**63), 2**63 - 1)),
    "standoff_mm": (pa.float64(), st.floats() | st.integers(-(2**53), 2**53)),
}


@settings(deadline=None)
@given(
    rows=st.lists(
        st.fixed_dictionaries({name: st.none() | values for name, (_, values) in COLUMNS.items()}),
        max_size=40,
    )
)
def test_columns_are_arrows(rows):
    needed = {
        "split": "train", "share_valid": 0.5, "depth_mean_mm": None, "part": "a", "surface": None
    }  # fmt: skip
    sensor = {"name": "s", "effects": [], "triangulation_angle_deg": None}
    facts = {
        "failed": [], "split_by": "part", "recipe": {"splits": {"train": 1.0}, "sensor": sensor}
    }  # fmt: skip
    journal = {
        "shard": "a", "sha256": "b", "scans": [{**needed, **row} for row in rows], "flaws": [],
        "failed": [], "redrawn": 0, "dropped": [],
    }  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        write_manifest(Path(folder), journals=[journal], facts=facts)
        table = pq.read_table(Path(folder) / "manifest.parquet")
    for name, (kind, _) in COLUMNS.items():
        made, expected = table[name].combine_chunks(), pa.array([row[name] for row in rows], kind)
        assert made.type == expected.type
        assert made.null_count == expected.null_count
        made.validate(full=True)
        for one, other in zip(made.to_pylist(), expected.to_pylist(), strict=True):
            assert one == other or (one != one and other != other)


def test_no_pandas_for_it(tmp_path):
    code = (
        "import sys\nfrom pathlib import Path\n"
        "from pipeline.dataset.manifest import write_manifest\n"
        "row = {'split': 'train', 'share_valid': 0.5, 'depth_mean_mm': None, 'part': 'a',"
        " 'surface': None}\n"
        "sensor = dict(name='s', effects=[], triangulation_angle_deg=None)\n"
        "facts = dict(failed=[], split_by='part', recipe=dict(splits={'train': 1.0},"
        " sensor=sensor))\n"
        "journal = dict(shard='a', sha256='b', scans=[row], flaws=[], failed=[], redrawn=0,"
        " dropped=[])\n"
        f"write_manifest(Path({str(tmp_path)!r}), journals=[journal], facts=facts)\n"
        "sys.exit('pandas' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], cwd=HOME, check=False).returncode == 0
