"""Numbers of a recipe that may be drawn: `Distribution` as a field of a record."""

from typing import Annotated, Any

from pydantic import PlainValidator

from quantity import distribution


def _read(value: Any) -> distribution.Distribution:
    return value if hasattr(value, "draw") else distribution.parse_distribution(value)


Distribution = Annotated[distribution.Distribution, PlainValidator(_read)]
