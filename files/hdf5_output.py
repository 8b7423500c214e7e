"""A file for HDF5 that hides faults of the disk from the library.

After a failed write HDF5 keeps the file open, retries at interpreter exit, and crashes Python. Here
the first fault is kept, later writes are dropped, and the writer raises the fault.
"""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py

from files.whole_file import whole


class Output(io.RawIOBase):
    """A new, empty file object for `h5py.File`.

    Attributes
    ----------
    fault
        The first fault of the system; nothing is written from then on.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.path = path
        self.fault: OSError | None = None
        self._disk = io.FileIO(path, "w+")

    def seek(self, offset: int, whence: int = os.SEEK_SET, /) -> int:
        """Move to an offset."""
        return self._disk.seek(offset, whence)

    def tell(self) -> int:
        """Return the offset."""
        return self._disk.tell()

    def readinto(self, buffer: Any, /) -> int | None:
        """Read data back that HDF5 has evicted."""
        return self._disk.readinto(buffer)

    def write(self, data: Any, /) -> int:
        """Write all of the data, or keep the fault."""
        rest = memoryview(data).cast("B")
        length = len(rest)
        try:
            while rest and self.fault is None:
                rest = rest[self._disk.write(rest) :]
        except OSError as fault:
            self._keep(fault)
        return length

    def truncate(self, size: int | None = None, /) -> int:
        """Set the length, or keep the fault."""
        size = self.tell() if size is None else size
        try:
            if self.fault is None:
                self._disk.truncate(size)
        except OSError as fault:
            self._keep(fault)
        return size

    def close(self) -> None:
        """Close the file; a fault stays kept."""
        try:
            self._disk.close()
        except OSError as fault:
            self._keep(fault)
        super().close()

    def _keep(self, fault: OSError) -> None:
        self.fault = self.fault or OSError(fault.errno, fault.strerror, str(self.path))

    def check(self) -> None:
        """Raise the fault that was kept.

        Raises
        ------
        OSError
            Where the system couldn't write.
        """
        if self.fault is not None:
            raise self.fault


@contextmanager
def created(path: str | Path) -> Iterator[h5py.File]:
    """Write a new HDF5 file within a context; a fault leaves no file.

    Raises
    ------
    OSError
        Where the system couldn't write.
    """
    with whole(path) as aside:
        output = Output(aside)
        with output, h5py.File(output, "w") as file:
            yield file
        output.check()
