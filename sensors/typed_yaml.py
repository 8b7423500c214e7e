"""Files of users: read as data, checked against a type, with one-line errors.

Only this module uses PyYAML and pydantic. A type is a `record`: a frozen dataclass whose
fields carry their own limits (`quantity(...)`).
"""

import dataclasses
import difflib
import inspect
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, TypeVar, dataclass_transform

import yaml
from pydantic import AfterValidator, ConfigDict, TypeAdapter, ValidationError, with_config

from quantity import quantity

T = TypeVar("T")
KeyPath = tuple[str | int, ...]
PLAIN_WORDS = {
    "tuple_type": "a list",
    "list_type": "a list",
    "dict_type": "keys and values",
    "dataclass_type": "keys and values",
    "string_type": "a text",
    "int_type": "a whole number",
    "int_parsing": "a whole number",
    "int_parsing_size": "a whole number",
    "int_from_float": "a whole number",
    "float_type": "a number",
    "float_parsing": "a number",
}
UNKNOWN_KEY = ("unexpected_keyword_argument", "extra_forbidden")


MOST_BYTES = 4_000_000
MOST_VALUES = 200_000
LONGEST_NUMBER = 40
"""Longest file of a user: a hundred times the longest known one."""


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


class RecipeError(ValueError):
    """Wrong input of a user: fault, place, value, allowed values; always one line."""

    def __init__(
        self,
        what: str,
        *,
        where: str | Path | None = None,
        value: object = dataclasses.MISSING,
        allowed: str | None = None,
    ) -> None:
        line = f"{where}: {what}" if where is not None else what
        if value is not dataclasses.MISSING:
            line += f", got {_short(value)}"
        if allowed is not None:
            line += f"; allowed: {allowed}"
        super().__init__(" ".join(line.split()))


@dataclass_transform(
    kw_only_default=True, frozen_default=True, field_specifiers=(dataclasses.field, quantity)
)
def record(cls: type[T]) -> type[T]:
    """Make `cls` a frozen, keyword-only, slotted dataclass that refuses unknown keys.

    A field made by `quantity` refuses numbers out of its bounds.
    """
    annotations = dict(inspect.get_annotations(cls))
    for name, declared in vars(cls).items():
        if isinstance(declared, dataclasses.Field) and "quantity" in declared.metadata:
            check = AfterValidator(declared.metadata["quantity"].check)
            annotations[name] = Annotated[annotations[name], check]
    cls.__annotations__ = annotations
    configured = with_config(ConfigDict(extra="forbid", allow_inf_nan=False))(cls)
    return dataclasses.dataclass(frozen=True, kw_only=True, slots=True)(configured)


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
            raise RecipeError("isn't a file", where=path)
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


def parse(cls: type[T], source: Document | Mapping[str, Any], *, where: str | None = None) -> T:
    """Check plain data against the record `cls` and build it.

    Parameters
    ----------
    cls : type
        A `record` (records may hold records).
    source : Document or mapping
        The data; of a `Document`, messages give the line.
    where : str, optional
        What to call the source in messages where it isn't a file.

    Raises
    ------
    RecipeError
        For the first key that is unknown, missing or out of its limits.
    """
    data = source.data if isinstance(source, Document) else source
    try:
        return TypeAdapter(cls).validate_python(data)
    except ValidationError as error:
        found = _own(error.errors(include_url=False))
        # a misspelt key also makes one missing: name the misspelling
        first = min(found, key=lambda entry: entry["type"] not in UNKNOWN_KEY)
        # pydantic names the branch of a union in the path: keep what the data holds
        path = _path_in(data, first["loc"])
        said = first["msg"].removeprefix("Value error, ")
        path, said, located = _deeper(data, path, said)
        place = source.where(path) if isinstance(source, Document) else where
        key = ".".join(str(part) for part in path) or "the top level"
        kind = first["type"]
        more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
        if kind in UNKNOWN_KEY:
            allowed = _keys_at(cls, path[:-1])
            close = difflib.get_close_matches(str(path[-1]), allowed, n=1)
            hint = f"did you mean '{close[0]}'? " if close else ""
            raise RecipeError(
                f"unknown key '{key}'{more}",
                where=place,
                allowed=hint + ", ".join(sorted(allowed)) if allowed else None,
            ) from None
        missing = first["loc"][-1] if first["loc"] else None
        if kind.startswith("missing") and isinstance(missing, str):
            inside = f" in '{key}'" if path else ""
            raise RecipeError(f"key '{missing}' is missing{inside}{more}", where=place) from None
        if kind.startswith("missing"):  # of a list of a fixed length
            raise RecipeError(
                f"'{key}' has too few entries{more}", where=place, value=_at(data, path)
            ) from None
        if located:
            raise RecipeError(f"'{key}': {said}{more}", where=place) from None
        allowed_text = PLAIN_WORDS.get(kind) or said.removeprefix("Input should be ")
        if kind == "too_short":
            least = first["ctx"]["min_length"]
            allowed_text = "at least one entry" if least == 1 else f"at least {least} entries"
        raise RecipeError(
            f"'{key}' has a wrong value{more}",
            where=place,
            value=first["input"],
            allowed=allowed_text,
        ) from None


def _own(found: Sequence[Any]) -> list[Any]:
    """Omit lists that are too short only because of a wrong entry."""
    places = [entry["loc"] for entry in found]
    return [
        entry
        for entry in found
        if entry["type"] != "too_short"
        or not any(
            len(place) > len(entry["loc"]) and place[: len(entry["loc"])] == entry["loc"]
            for place in places
        )
    ]


def _deeper(data: Any, path: KeyPath, said: str) -> tuple[KeyPath, str, bool]:
    """Follow a message that starts with a key ('dent.depth_mm: ...') to that key."""
    head, colon, rest = said.partition(": ")
    data = _at(data, path)
    keys = head.split(".")
    if not colon or not isinstance(data, Mapping) or keys[0] not in data:
        return path, said, False
    return (*path, *keys), rest, True


def _at(data: Any, path: KeyPath) -> Any:
    for part in path:
        data = data[part]
    return data


def _path_in(data: Any, location: Iterable[str | int]) -> KeyPath:
    path: list[str | int] = []
    for part in location:
        in_mapping = isinstance(data, Mapping) and part in data
        in_list = isinstance(data, (list, tuple)) and isinstance(part, int) and part < len(data)
        if not (in_mapping or in_list):
            continue
        data = data[part]
        path.append(part)
    return tuple(path)


def _keys_at(cls: type, path: KeyPath) -> list[str]:
    """Keys that a record allows, where the path leads through records alone."""
    for part in path:
        if isinstance(part, int):
            continue
        fields = {f.name: f.type for f in dataclasses.fields(cls)} if _is_record(cls) else {}
        cls = next((c for c in _records_in(fields.get(str(part)))), object)
    return [f.name for f in dataclasses.fields(cls)] if _is_record(cls) else []


def _is_record(cls: object) -> bool:
    return isinstance(cls, type) and dataclasses.is_dataclass(cls)


def _records_in(annotation: Any) -> list[type]:
    if _is_record(annotation):
        return [annotation]
    inner = getattr(annotation, "__args__", ())
    return [found for argument in inner for found in _records_in(argument)]


def plain(value: Any) -> Any:
    """Convert a record (or nested records and numpy scalars) to plain data for YAML or JSON."""
    if hasattr(value, "to_recipe"):
        return value.to_recipe()
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(entry) for entry in value]
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def dump_yaml(value: Any) -> str:
    """Write plain data or a record as YAML, in the order of its keys."""
    text: str = yaml.dump(
        plain(value), Dumper=Dumper, sort_keys=False, allow_unicode=True, width=100
    )
    return text


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
