"""A run needs a sealed set."""

import pytest

from challenge.runs.run import run


def test_run_refuses_an_unsealed_set(tmp_path):
    with pytest.raises(ValueError, match="commitments"):
        run(tmp_path, jobs=1, timeout_s=1.0)
