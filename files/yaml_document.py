"""YAML that users write: data only, each key once, and the line that each value stands on.

Only this module uses PyYAML.
"""

import dataclasses
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from files.errors import RecipeError
from files.plain_data import plain

KeyPath = tuple[str | int, ...]
MOST_BYTES = 4_000_000
"""Longest file of a user: a hundred times the longest known one."""
MOST_VALUES = 200_000
"""Values of a file, those of its aliases counted at each use."""
LONGEST_NUMBER = 40
"""Digits of a whole number."""


class Loader(yaml.SafeLoader):
    """Loads data only; 1e9 is a number, as in YAML 1.2."""


class Dumper(yaml.SafeDumper):
    """Quotes a text that the loader would read as a number."""


for each in (Loader, Dumper):
    each.add_implicit_resolver(
        "tag:yaml.org,2002:float",
        re.compile(r"[-+]?[0-9]+(\.[0-9]*)?[eE][-+]?[0-9]+$"),
        list("-+0123456789"),
    )


@dataclasses.dataclass(frozen=True, kw_only=True, slots=True)
class Document:
    """A YAML file as plain data, with the line of each key path.

    `places` holds the origin of values from another file or the command line.
    """

    path: Path
    data: Any
    lines: Mapping[KeyPath, int]
    places: Mapping[KeyPath, str] = dataclasses.field(default_factory=dict)

    def where(self, key_path: Sequence[str | int]) -> str:
        """Return 'file:line' of the deepest part of `key_path` that the file holds."""
        path = tuple(key_path)
        while path and path not in self.lines and path not in self.places:
            path = path[:-1]
        if path not in self.lines and path in self.places:
            return self.places[path]
        line = self.lines.get(path)
        return f"{self.path}:{line}" if line is not None else str(self.path)


def load_yaml(path: str | Path) -> Document:
    """Read a YAML file safely (data only, no duplicate keys).

    Raises
    ------
    RecipeError
        Where the file is unreadable, no YAML, or no mapping.
    """
    path = Path(path)
    try:
        if path.exists() and not path.is_file():
            kind = "is a folder" if path.is_dir() else "isn't a regular file"
            raise RecipeError(kind, where=path, allowed="a .yaml file")
        if path.stat().st_size > MOST_BYTES:
            raise RecipeError(
                "is too long for a hand-written file", where=path,
                value=f"{path.stat().st_size} bytes", allowed=f"{MOST_BYTES} at most",
            )  # fmt: skip
        text = path.read_text(encoding="utf-8")
    except RecipeError:
        raise
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "not a UTF-8 text"
        raise RecipeError(f"can't be read ({reason})", where=path) from None
    try:
        node = yaml.compose(text, Loader=Loader)
        _check_size(node, path)
        data = yaml.load(text, Loader=Loader)  # a SafeLoader
    except RecipeError:
        raise
    except Exception as error:  # PyYAML raises whatever it stumbles over in a value
        mark = getattr(error, "problem_mark", None)
        where = f"{path}:{mark.line + 1}" if mark is not None else str(path)
        problem = getattr(error, "problem", None) or str(error)
        raise RecipeError(f"isn't YAML ({problem})", where=where) from None
    if not isinstance(data, dict):
        raise RecipeError("should hold keys and values", where=path, value=data)
    lines: dict[KeyPath, int] = {}
    _note_lines(node, (), lines, path)
    return Document(path=path, data=data, lines=lines)


def parse_text(text: str, *, where: str) -> Any:
    """Read a value in YAML notation.

    Raises
    ------
    RecipeError
        Where it isn't YAML.
    """
    try:
        return yaml.load(text, Loader=Loader)  # a SafeLoader
    except Exception:  # as above
        raise RecipeError("isn't a value", where=where, value=text, allowed="as in YAML") from None


def _check_size(node: Any, path: Path) -> None:
    """Refuse a document whose aliases expand to too many values."""
    sizes: dict[int, int] = {}

    def size(one: Any, depth: int) -> int:
        if depth > 100:
            raise RecipeError("is nested too deeply or refers to itself", where=path)
        if id(one) not in sizes:
            children: list[Any] = []
            if isinstance(one, yaml.MappingNode):
                children = [part for pair in one.value for part in pair]
            elif isinstance(one, yaml.SequenceNode):
                children = list(one.value)
            else:
                _check_scalar(one, path)
            sizes[id(one)] = 1 + sum(size(child, depth + 1) for child in children)
        return sizes[id(one)]

    if node is not None and size(node, 0) > MOST_VALUES:
        raise RecipeError(
            "holds too many values, aliases counted", where=path, value=sizes[id(node)],
            allowed=f"{MOST_VALUES} at most",
        )  # fmt: skip


def _check_scalar(node: Any, path: Path) -> None:
    """Refuse text that is no Unicode, and numbers with too many digits."""
    where = f"{path}:{node.start_mark.line + 1}"
    if any("\ud800" <= sign <= "\udfff" for sign in node.value):
        raise RecipeError("holds a lone surrogate, which is no character", where=where)
    if node.tag.endswith(":int") and len(node.value) > LONGEST_NUMBER:
        raise RecipeError(
            "holds a number that is too long", where=where, value=f"{len(node.value)} digits",
            allowed=f"{LONGEST_NUMBER} at most",
        )  # fmt: skip


def _note_lines(node: Any, at: KeyPath, lines: dict[KeyPath, int], path: Path) -> None:
    if len(at) > 100:
        raise RecipeError("is nested too deeply or refers to itself", where=path)
    if isinstance(node, yaml.MappingNode):
        seen = set()
        for key, value in node.value:
            if key.value in seen:
                line = key.start_mark.line + 1
                raise RecipeError(f"key '{key.value}' occurs twice", where=f"{path}:{line}")
            seen.add(key.value)
            lines[(*at, key.value)] = key.start_mark.line + 1
            _note_lines(value, (*at, key.value), lines, path)
    elif isinstance(node, yaml.SequenceNode):
        for index, value in enumerate(node.value):
            lines[(*at, index)] = value.start_mark.line + 1
            _note_lines(value, (*at, index), lines, path)


def dump_yaml(value: Any) -> str:
    """Write plain data or a record as YAML, in the order of its keys."""
    text: str = yaml.dump(
        plain(value), Dumper=Dumper, sort_keys=False, allow_unicode=True, width=100
    )
    return text
