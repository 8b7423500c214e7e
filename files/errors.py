"""What a user wrote is wrong: one line that names fault, place, value and what is allowed."""

import dataclasses
from pathlib import Path


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


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
