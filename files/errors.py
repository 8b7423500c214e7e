"""What a user wrote is wrong: one line that names fault, place, value and what is allowed."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import TypedDict


class RecipeError(ValueError):
    """Wrong input of a user: fault, place, value, allowed values; always one line."""

    def __init__(
        self,
        what: str,
        *,
        where: str | Path | None = None,
        value: object = dataclasses.MISSING,
        allowed: str | None = None,
        hint: str | None = None,
    ) -> None:
        line = f"{where}: {what}" if where is not None else what
        if value is not dataclasses.MISSING:
            line += f", got {_short(value)}"
        if allowed is not None:
            line += f"; allowed: {allowed}"
        if hint is not None:
            line += f"; {hint}"
        super().__init__(" ".join(line.split()))


class Known(TypedDict, total=False):
    """What an error says of an unknown word, as arguments of `RecipeError`."""

    allowed: str
    hint: str


def known(word: str, words: Sequence[str], *, more: str = "") -> Known:
    """Return the nearest of the words that are known; where none is near, all of them.

    Parameters
    ----------
    more : what else is allowed, before the words
    """
    import difflib

    if not words:
        return {}
    close = difflib.get_close_matches(word, words, n=1)
    if close:
        return {"hint": f"did you mean '{close[0]}'?"}
    return {"allowed": more + ", ".join(words)}


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
