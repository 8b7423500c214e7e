"""The error of a mesh that can't be used."""

from __future__ import annotations

import os


class PartError(ValueError):
    """A mesh that can't be used: one line with the file, what is wrong and where, and the mend."""

    def __init__(self, source: str | os.PathLike[str], wrong: str, mend: str) -> None:
        self.source = os.fspath(source)
        self.wrong = " ".join(wrong.split())
        self.mend = " ".join(mend.split())
        super().__init__(f"{self.source}: {self.wrong}; mend: {self.mend}")

    def __reduce__(self) -> tuple[type[PartError], tuple[str, str, str]]:
        return PartError, (self.source, self.wrong, self.mend)
