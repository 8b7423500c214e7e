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
    room : size of all that is kept, about; objects share it; None for any
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
        values = self._of.setdefault(owner, {})
        if key in values:
            values[key] = values.pop(key)
            return values[key]
        value = make()
        if keep:
            share = self._share(owner, size)
            while len(values) >= share:
                del values[next(iter(values))]
            values[key] = value
        return value

    def _share(self, owner: object, size: int) -> int:
        if self._room is None:
            return self._most
        self._sizes[owner] = size
        return max(1, min(self._most, self._room // sum(self._sizes.values())))
