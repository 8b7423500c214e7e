"""What is dear and soon asked for again, kept with the view it was made for and gone with it."""

from collections.abc import Callable, Hashable
from typing import Generic, TypeVar
from weakref import WeakKeyDictionary

T = TypeVar("T")


class Kept(Generic[T]):
    """The last few values that were made for an object.

    Parameters
    ----------
    most : how many of each object
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._of: WeakKeyDictionary[object, dict[Hashable, T]] = WeakKeyDictionary()

    def get(
        self, owner: object, key: Hashable, make: Callable[[], T], *, keep: bool = True
    ) -> T:
        """Return what was made under a key, or make it; the one last asked for goes last."""
        values = self._of.setdefault(owner, {})
        if key in values:
            values[key] = values.pop(key)
            return values[key]
        value = make()
        if keep:
            if len(values) >= self._most:
                del values[next(iter(values))]
            values[key] = value
        return value
