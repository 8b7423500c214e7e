"""What the payoff needs of a family of instruments: its worlds, scans, and a stranger's files."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from challenge.cases.case import Secret
from challenge.cases.seeds import number
from challenge.payoff.specimens import Specimen

CONTROL = "nothing"
"""The world of each family in which the nominal model lacks no effect."""
STRONG = 2
_TRIES = 5


@dataclass(frozen=True, kw_only=True, slots=True)
class World:
    """The effect that the nominal simulation lacks in one world.

    Attributes
    ----------
    switch
        A name of the family's switches; empty where nothing is missing.
    words
        For the page.
    shape
        Of the part.
    """

    switch: str
    words: str
    shape: str = "waves"


@dataclass(frozen=True, kw_only=True, slots=True)
class Ready:
    """A world ready to be scanned: the staged case, and its seed."""

    name: str
    secret: Secret
    staged: Any


class Family(Protocol):
    """A module of worlds."""

    WORLDS: dict[str, World]
    BASELINES: tuple[str, ...]

    def ready(self, name: str, seed: int) -> Ready:
        """Draw a world's part and instrument and calibrate it."""

    def write_stranger(self, world: Ready, folder: FilePath) -> None:
        """Write what a stranger has: recordings of the clean part, file and plates as accepted."""

    def specimen(self, world: Ready, purpose: str, k: int) -> Specimen:
        """Draw a flawed specimen of the world's part, and the path that it is scanned on."""

    def scan(
        self, world: Ready, purpose: str, k: int, made: Specimen
    ) -> NDArray[np.float32]:
        """Scan a specimen with the world's instrument; every specimen has its own surface."""

    def columns(self, world: Ready) -> int:
        """Count the readings of a profile."""

    def pattern(
        self, world: Ready
    ) -> Callable[[NDArray[np.float64]], NDArray[np.float64]] | None:
        """Brightness of the part's print at points of it; None without one."""


def first_solid(
    name: str, seed: int, world: World, stage: Callable[[Secret], Any], **more: Any
) -> Ready:
    """Stage a world, with another part where one was no solid.

    Parameters
    ----------
    more
        Of the secret, what a family has beside the other.

    Raises
    ------
    RuntimeError
        Where several parts in a row were no solids.
    """
    for attempt in range(_TRIES):
        secret = Secret(
            kind="one" if world.switch else "null",
            switches=(world.switch,) if world.switch else (),
            strength=STRONG, shape=world.shape, recordings=3,
            seed=number(seed, "payoff", name, str(attempt)), **more,
        )  # fmt: skip
        try:
            return Ready(name=name, secret=secret, staged=stage(secret))
        except ValueError:
            continue
    raise RuntimeError(f"{name}: {_TRIES} parts in a row were no solids")
