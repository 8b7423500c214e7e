"""The shards of a folder, opened at first access in each process."""

import os
from collections import OrderedDict
from pathlib import Path
from typing import Any, Final

from flawforge.open_shard import OpenShard, place

MOST_OPEN: Final = 16
"""Shards that a process holds open for one folder."""


class ShardFolder:
    """Shards by name, the last few of them open.

    Files are not pickled and not shared with a fork, so processes can share a folder.

    Parameters
    ----------
    path : Path
    most : int
        Shards that a process holds open; the least recently used is closed.
    """

    def __init__(self, path: Path, *, most: int = MOST_OPEN) -> None:
        self.path = path
        self._most = most
        self._open: OrderedDict[str, OpenShard] = OrderedDict()
        self._process: int | None = os.getpid()

    def __getitem__(self, name: str) -> OpenShard:
        """Return an open shard.

        Raises
        ------
        ShardError
            Where it is missing or damaged.
        """
        if self._process != os.getpid():
            # handles inherited by a fork share the parent's file position: forget, don't close;
            # a store's connection is the parent's, too
            self._open, self._process = OrderedDict(), os.getpid()
            self.path = place(str(self.path))
        if name in self._open:
            self._open.move_to_end(name)
            return self._open[name]
        shard = self._open[name] = OpenShard.at(self.path / name)
        if len(self._open) > self._most:
            self._open.popitem(last=False)[1].close()
        return shard

    @property
    def opened(self) -> tuple[str, ...]:
        """Names of the shards that this process holds open, the last used last."""
        return tuple(self._open) if self._process == os.getpid() else ()

    def close(self) -> None:
        """Close the files that this process holds; they reopen when needed."""
        if self._process == os.getpid():
            for shard in self._open.values():
                shard.close()
        self._open = OrderedDict()

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_open": OrderedDict(), "_process": None}
