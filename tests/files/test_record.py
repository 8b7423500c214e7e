"""User files: what is wrong is said in one line, with file and line."""

from pathlib import Path
from typing import Annotated

import pytest
from annotated_types import Len

from files.errors import RecipeError
from files.record import parse, record
from files.yaml_document import dump_yaml, load_yaml
from quantity import quantity


@record
class Inner:
    size_mm: float = quantity("size", unit="mm", low=0, above=True, default=1.0)


@record
class Bounds:
    low: float
    high: float

    def __post_init__(self) -> None:
        if self.low > self.high:
            raise ValueError(f"low: {self.low:g} must be below {self.high:g}")


@record
class Outer:
    name: str
    inner: tuple[Inner, ...] = ()
    at_mm: tuple[float, float, float] | None = None
    bounds: Bounds | None = None
    sizes: Annotated[tuple[Inner, ...], Len(1)] | None = None


def written(folder: Path, text: str) -> Path:
    path = folder / "file.yaml"
    path.write_text(text)
    return path


def test_reads_nested_records(tmp_path):
    found = parse(Outer, load_yaml(written(tmp_path, "name: a\ninner:\n  - size_mm: 1e-3\n")))
    assert found == Outer(name="a", inner=(Inner(size_mm=0.001),))


def test_round_trip(tmp_path):
    value = Outer(name="ü", inner=(Inner(size_mm=0.1),))
    assert parse(Outer, load_yaml(written(tmp_path, dump_yaml(value)))) == value
    like_a_number = Outer(name="1e3")
    assert parse(Outer, load_yaml(written(tmp_path, dump_yaml(like_a_number)))) == like_a_number


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("name: a\ninner:\n  - size_mm: -1\n", [":3", "inner.0.size_mm", "-1", "above 0 mm"]),
        ("name: a\ninner:\n  - sise_mm: 1\n", [":3", "sise_mm", "did you mean 'size_mm'"]),
        ("inner: []\n", ["'name' is missing"]),
        ("name: a\nname: b\n", [":2", "'name' occurs twice"]),
        ("name: [a\n", ["isn't YAML"]),
        ("- name\n", ["should hold keys and values"]),
        ("name: !!python/object/apply:os.system [ls]\n", ["isn't YAML"]),
        ("name: a\ninner:\n  - size_mm: .nan\n", ["inner.0.size_mm"]),
        ("a: &a [*a]\n", []),
        ("name: a\nat_mm: [1, 2]\n", [":2", "'at_mm' has too few entries", "[1, 2]"]),
        ("name: a\nbounds: {low: 3, high: 1}\n", [":2", "'bounds.low': 3 must be below 1"]),
        ("name: a\nsizes: []\n", [":2", "at least one entry"]),
        ("name: a\nsizes: [{size_mm: 0}]\n", [":2", "'sizes.0.size_mm' has a wrong value, got 0"]),
    ],
)
def test_errors_are_one_line(tmp_path, text, words):
    path = written(tmp_path, text)
    with pytest.raises(RecipeError) as caught:
        parse(Outer, load_yaml(path))
    message = str(caught.value)
    assert "\n" not in message
    assert str(path) in message
    for word in words:
        assert word in message
