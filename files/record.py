"""Records: the types that users' files are checked against, with one-line errors.

A `record` is a frozen dataclass whose fields carry their own limits (`quantity(...)`).
"""

import dataclasses
import inspect
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Any, TypeVar, dataclass_transform

from pydantic import AfterValidator, ConfigDict, TypeAdapter, ValidationError, with_config

from files.errors import RecipeError, known
from files.yaml_document import Document, KeyPath
from quantity import quantity

T = TypeVar("T")
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
            raise RecipeError(
                f"unknown key '{key}'{more}", where=place, **known(str(path[-1]), sorted(allowed))
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
