"""A cache of expensive values of a view, with the view's lifetime."""

from collections.abc import Callable, Hashable
from typing import Generic, TypeVar
from weakref import WeakKeyDictionary

T = TypeVar("T")


class ViewCache(Generic[T]):
    """The last few values that were made for an object.

    Parameters
    ----------
    most : how many of each object
    room : size of all that is kept, about; objects share it, and those that were asked least
        recently make room; None for any
    """

    def __init__(self, most: int, *, room: int | None = None) -> None:
        self._most = most
        self._room = room
        self._of: WeakKeyDictionary[object, dict[Hashable, T]] = WeakKeyDictionary()
        self._sizes: WeakKeyDictionary[object, int] = WeakKeyDictionary()

    def get(
        self, owner: object, key: Hashable, make: Callable[[], T], *, keep: bool = True,
        size: int = 1,
    ) -> T:  # fmt: skip
        """Return the value of a key, computed once; the least recently used value is dropped.

        Parameters
        ----------
        size : of each value of this owner, in the units of `room`
        """
        values = self._of.pop(owner, {})
        self._of[owner] = values
        if key in values:
            values[key] = values.pop(key)
            return values[key]
        value = make()
        if keep:
            self._make_room(values, owner, size)
            values[key] = value
        return value

    def _make_room(self, values: dict[Hashable, T], owner: object, size: int) -> None:
        while len(values) >= self._most:
            del values[next(iter(values))]
        if self._room is None:
            return
        self._sizes[owner] = size
        left = self._room - size - sum(self._sizes[o] * len(v) for o, v in self._of.items() if v)
        for other, theirs in list(self._of.items()):
            while left < 0 and theirs:
                del theirs[next(iter(theirs))]
                left += self._sizes[other]
