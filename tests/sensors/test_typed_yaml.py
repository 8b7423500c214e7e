"""User files: what is wrong is said in one line, with file and line."""

from pathlib import Path
from typing import Annotated

import pytest
from annotated_types import Gt

from sensors.typed_yaml import RecipeError, dump_yaml, load_yaml, parse, plain, record


@record
class Inner:
    size_mm: Annotated[float, Gt(0)] = 1.0


@record
class Outer:
    name: str
    inner: tuple[Inner, ...] = ()


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
    assert plain(value) == {"name": "ü", "inner": [{"size_mm": 0.1}]}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("name: a\ninner:\n  - size_mm: -1\n", [":3", "inner.0.size_mm", "-1", "greater than 0"]),
        ("name: a\ninner:\n  - sise_mm: 1\n", [":3", "sise_mm", "did you mean 'size_mm'"]),
        ("inner: []\n", ["'name' is missing"]),
        ("name: a\nname: b\n", [":2", "'name' stands twice"]),
        ("name: [a\n", ["isn't YAML"]),
        ("- name\n", ["should hold keys and values"]),
        ("name: !!python/object/apply:os.system [ls]\n", ["isn't YAML"]),
        ("name: a\ninner:\n  - size_mm: .nan\n", ["inner.0.size_mm"]),
        ("a: &a [*a]\n", []),
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


def test_a_missing_file_is_an_error_of_the_users(tmp_path):
    with pytest.raises(RecipeError, match="can't be read"):
        load_yaml(tmp_path / "none.yaml")
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(RecipeError, match="can't be read"):
        load_yaml(tmp_path / "binary.yaml")
