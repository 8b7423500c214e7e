"""YAML that users write: data only, within budget, each value with its line."""

from pathlib import Path

import pytest

from files.errors import RecipeError
from files.yaml_document import MOST_BYTES, dump_yaml, load_yaml, parse_text


def written(folder: Path, text: str) -> Path:
    path = folder / "file.yaml"
    path.write_text(text)
    return path


def test_a_number_with_an_exponent_alone_is_a_number(tmp_path: Path) -> None:
    data = load_yaml(written(tmp_path, "a: 1e9\nb: -2E-3\nc: 1e\n")).data
    assert data == {"a": 1e9, "b": -0.002, "c": "1e"}
    assert load_yaml(written(tmp_path, dump_yaml({"text": "1e9"}))).data == {"text": "1e9"}


def test_the_deepest_known_key_names_the_line(tmp_path: Path) -> None:
    document = load_yaml(written(tmp_path, "a: 1\nb:\n  - c: 2\n  - c: 3\n"))
    assert document.where(("b", 1, "c")).endswith("file.yaml:4")
    assert document.where(("b", 1, "d", "e")).endswith("file.yaml:4")
    assert document.where(("z",)) == str(document.path)


def test_a_file_that_cannot_be_read_is_an_error_of_the_users(tmp_path: Path) -> None:
    with pytest.raises(RecipeError, match="none.yaml: can't be read"):
        load_yaml(tmp_path / "none.yaml")
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(RecipeError, match="can't be read"):
        load_yaml(tmp_path / "binary.yaml")
    with pytest.raises(RecipeError, match=r"is a folder; allowed: a \.yaml file"):
        load_yaml(tmp_path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x" * (MOST_BYTES + 1), "too long for a hand-written file"),
        ("a: " + "9" * 60, "file.yaml:1: holds a number that is too long, got '60 digits'"),
        ("a: &a [1, 2]\n" + "b: [" + ", ".join(["*a"] * 100_000) + "]", "too many values"),
        ("a: " + "[" * 200 + "]" * 200, "nested too deeply"),
        ("a: !!python/name:os.system", "isn't YAML"),
    ],
)
def test_what_costs_too_much_or_runs_code_is_refused(
    tmp_path: Path, text: str, words: str
) -> None:
    with pytest.raises(RecipeError) as fault:
        load_yaml(written(tmp_path, text))
    assert words in str(fault.value)
    assert "\n" not in str(fault.value)


def test_a_value_of_the_command_line_is_yaml() -> None:
    assert parse_text("{dent: 1}", where="--set") == {"dent": 1}
    with pytest.raises(RecipeError, match="--set: isn't a value, got '{dent'; allowed: as in YAML"):
        parse_text("{dent", where="--set")
