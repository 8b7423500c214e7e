"""Numbers of a recipe that may be drawn: `Size` as a field of a record."""

from typing import Annotated, Any

from pydantic import PlainValidator

from defects import sizes


def _read(value: Any) -> sizes.Size:
    return value if hasattr(value, "draw") else sizes.parse_size(value)


Size = Annotated[sizes.Size, PlainValidator(_read)]
