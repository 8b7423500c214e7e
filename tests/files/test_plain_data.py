"""Records, arrays and paths as plain data."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from files.plain_data import plain


@dataclass
class Inner:
    size_mm: float
    where: Path


class Distribution:
    def to_recipe(self) -> dict[str, list[int]]:
        """Return its form in a recipe."""
        return {"uniform": [1, 2]}


def test_nested_values_become_plain() -> None:
    value = {
        1: Inner(size_mm=0.5, where=Path("a/b")), "array": np.arange(3), "pair": (1, np.float32(2)),
        "drawn": Distribution(),
    }  # fmt: skip
    assert plain(value) == {
        "1": {"size_mm": 0.5, "where": "a/b"}, "array": [0, 1, 2], "pair": [1, 2.0],
        "drawn": {"uniform": [1, 2]},
    }  # fmt: skip


def test_what_json_cannot_hold_is_null() -> None:
    assert json.dumps(plain([np.nan, np.inf, np.float64("nan"), 1.0])) == "[null, null, null, 1.0]"
