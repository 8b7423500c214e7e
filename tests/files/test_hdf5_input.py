"""Numbers out of a stranger's HDF5 file: its own alone, and within budget."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from files.errors import RecipeError
from files.hdf5_input import has, lies_elsewhere, numbers


@pytest.fixture
def file(tmp_path: Path) -> h5py.File:
    with h5py.File(tmp_path / "other.h5", "w") as other:
        other["depth"] = np.arange(4.0)
    with h5py.File(tmp_path / "a.h5", "w") as made:
        made["own"] = np.arange(4, dtype=np.int16)
        made["text"] = "words"
        made["empty"] = h5py.Empty("f8")
        made["linked"] = h5py.ExternalLink("other.h5", "/depth")
        made["soft"] = h5py.SoftLink("/own")
        layout = h5py.VirtualLayout(shape=(4,), dtype="f8")
        layout[:] = h5py.VirtualSource("other.h5", "depth", shape=(4,))
        made.create_virtual_dataset("virtual", layout)
    return h5py.File(tmp_path / "a.h5")


def test_its_own_numbers_are_read(file: h5py.File) -> None:
    found = numbers(file, "own", "a.h5")
    assert found.dtype == np.float64
    assert found.tolist() == [0, 1, 2, 3]


@pytest.mark.parametrize("key", ["linked", "soft", "virtual"])
def test_what_leads_elsewhere_is_refused_without_being_opened(file: h5py.File, key: str) -> None:
    assert has(file, key)
    assert lies_elsewhere(file, key)
    with pytest.raises(RecipeError, match=f"a.h5: /{key} lies in another file; allowed: numbers"):
        numbers(file, key, "a.h5")


@pytest.mark.parametrize(
    ("key", "words"),
    [("none", "has no /none"), ("text", "/text should hold numbers"), ("empty", "/empty is empty")],
)
def test_what_holds_no_numbers_is_refused(file: h5py.File, key: str, words: str) -> None:
    with pytest.raises(RecipeError, match=f"a.h5: {words}"):
        numbers(file, key, "a.h5")


def test_more_than_the_budget_is_not_read(
    file: h5py.File, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FLAWFORGE_LIMITS", "readings=3")
    with pytest.raises(RecipeError, match="FLAWFORGE_LIMITS"):
        numbers(file, "own", "a.h5")
