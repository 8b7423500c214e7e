"""The tables' columns are Arrow's own, made without pandas."""

import subprocess
import sys
from pathlib import Path

import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.dataset.manifest import _column

HOME = Path(__file__).resolve().parents[3]
KINDS = {
    "text": (pa.string(), st.text()),
    "whole numbers": (pa.int64(), st.integers(-(2**63), 2**63 - 1)),
    "numbers": (pa.float64(), st.floats() | st.integers(-(2**53), 2**53)),
}


@pytest.mark.parametrize("name", KINDS)
@settings(deadline=None)
@given(data=st.data())
def test_a_column_is_arrows(name, data):
    kind, values = KINDS[name]
    column = data.draw(st.lists(st.none() | values, max_size=40))
    made, expected = _column(column, kind), pa.array(column, kind)
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
