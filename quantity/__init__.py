"""A number that users may set: one declaration of its meaning, unit, range, default and source.

Recipes, sensors, built-in parts, kinds of flaw and effects declare their numbers as fields made by
`quantity`; checks, messages and documents read them with `quantities`.
"""

import dataclasses
import functools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np


@dataclasses.dataclass(frozen=True, kw_only=True, slots=True)
class Quantity:
    """What is known about one number.

    Attributes
    ----------
    name : str
        Field and key in files; ends in its unit where it has one.
    meaning : str
        A phrase.
    unit : str
        "" for a ratio or a number of things.
    low, high : float
        Bounds, both allowed. For several values in one field they hold for each.
    above, below : bool
        Whether `low` or `high` itself is not allowed.
    typical : number, or (number, number), or None
        A value to start from or to show; or the range to draw from.
    default : object
        What the field holds where nothing is said; None without a default.
    source : str
        Where bounds or default come from; "" where the meaning says it all.
    whole : bool
        Whether it counts things.
    """

    name: str = ""
    meaning: str = ""
    unit: str = ""
    low: float = -math.inf
    high: float = math.inf
    above: bool = False
    below: bool = False
    typical: Any = None
    default: Any = None
    source: str = ""
    whole: bool = False

    def holds(self, value: object) -> bool:
        """Whether `value` is a number within the bounds."""
        if isinstance(value, bool) or not isinstance(value, (int, float, np.number)):
            return False
        number = float(value)
        at_least = number > self.low if self.above else number >= self.low
        return bool(at_least and (number < self.high if self.below else number <= self.high))

    def clipped(self, value: float) -> float:
        """Return the nearest value within closed bounds."""
        return min(max(value, self.low), self.high)

    @property
    def allowed(self) -> str:
        """The bounds as a user reads them: '0.2 to 200 mm', 'above 0 Hz', 'at least 2'."""
        low, high = _plain(self.low), _plain(self.high)
        least, most = math.isfinite(self.low), math.isfinite(self.high)
        if least and most and not self.above and not self.below:
            text = f"{low} to {high}"
        else:
            parts = [f"{'above' if self.above else 'at least'} {low}"] if least else []
            parts += [f"{'below' if self.below else 'at most'} {high}"] if most else []
            text = " and ".join(parts) or "any number"
        return f"{text} {self.unit}" if self.unit else text

    def check(self, value: Any) -> Any:
        """Return `value`: a number, None, a distribution, or several of these.

        Raises
        ------
        ValueError
            With what is allowed; where there are several, with key and value of the entry that
            is out of bounds before it.
        """
        for key, number in _numbers(value):
            if not self.holds(number):
                raise ValueError(
                    f"{key}: got {number!r}; allowed: {self.allowed}" if key else self.allowed
                )
        return value


def _plain(number: float) -> str:
    """Write a bound without exponent up to ten million."""
    whole = math.isfinite(number) and number == int(number) and abs(number) <= 1e7
    return str(int(number)) if whole else f"{number:g}"


def _numbers(value: Any, key: str = "") -> list[tuple[str, Any]]:
    """Numbers in a value, each with its key; a distribution counts by its limits."""
    if value is None:
        return []
    if isinstance(value, Mapping):
        return [n for name, entry in value.items() for n in _numbers(entry, _under(key, name))]
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [n for i, entry in enumerate(value) for n in _numbers(entry, _under(key, i))]
    limits = getattr(value, "limits", None)
    return [(key, number) for number in (limits() if callable(limits) else (value,))]


def _under(key: str, name: object) -> str:
    return f"{key}.{name}" if key else str(name)


def quantity(
    meaning: str,
    *,
    unit: str = "",
    low: float = -math.inf,
    high: float = math.inf,
    above: bool = False,
    below: bool = False,
    typical: Any = None,
    source: str = "",
    whole: bool = False,
    default: Any = dataclasses.MISSING,
    default_factory: Callable[[], Any] | None = None,
) -> Any:
    """Declare a field of a dataclass; see `Quantity`."""
    return declared(
        Quantity(
            meaning=meaning, unit=unit, low=low, high=high, above=above, below=below,
            typical=typical, source=source, whole=whole,
        ),
        default=default,
        default_factory=default_factory,
    )  # fmt: skip


def declared(
    known: Quantity,
    *,
    default: Any = dataclasses.MISSING,
    default_factory: Callable[[], Any] | None = None,
) -> Any:
    """Make the field of a dataclass that holds a quantity."""
    metadata = {"quantity": known}
    if default_factory is not None:
        return dataclasses.field(default_factory=default_factory, metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


def quantities(cls: type[Any]) -> tuple[Any, ...]:
    """Return the quantities of a dataclass, in the order of its fields."""
    known: Any = cls
    return _quantities(known)


@functools.cache
def _quantities(cls: Any) -> tuple[Any, ...]:
    return tuple(
        dataclasses.replace(
            field.metadata["quantity"],
            name=field.name,
            default=None if field.default is dataclasses.MISSING else field.default,
        )
        for field in dataclasses.fields(cls)
        if "quantity" in field.metadata
    )
