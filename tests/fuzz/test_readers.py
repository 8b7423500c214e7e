"""Damaged instruments' files are height maps or one line, whatever the byte."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from files.errors import RecipeError
from sensors.formats import read_height_map
from sensors.formats.height_map import HeightMap
from tests.fuzz.effort import effort
from tests.support.instrument_files import files
from tests.support.mutation import of_bytes

WHOLE = files(np.random.default_rng(0))
CASES = Path(__file__).parent / "cases"
"""What was found, by the suffix of its reader; a fault's file stays here."""


def answered(path: Path) -> bool:
    """Read; whether it was a height map. Anything but that or one line fails."""
    try:
        assert isinstance(read_height_map(path), HeightMap)
    except RecipeError as error:
        said = str(error)
    else:
        return True
    assert "\n" not in said, said
    return False


@pytest.mark.parametrize("name", sorted(WHOLE))
def test_the_undamaged_files_are_read(tmp_path, name):
    path = tmp_path / name
    path.write_bytes(WHOLE[name])
    assert answered(path)


@pytest.mark.filterwarnings("default")  # a line on standard error is no fault
@pytest.mark.parametrize("name", sorted(WHOLE))
@effort(40)
@given(seed=st.integers(0, 2**32))
def test_damaged_files(tmp_path_factory, name, seed):
    path = tmp_path_factory.getbasetemp() / name
    path.write_bytes(of_bytes(WHOLE[name], np.random.default_rng(seed)))
    answered(path)


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("path", sorted(CASES.glob("*.*")), ids=lambda path: path.name)
def test_found_cases(path, recwarn):
    answered(path)
    assert not recwarn.list
