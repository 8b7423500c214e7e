"""Named random streams: each stage of each sample draws from its own child of the recipe's seed.

A stream is identified by its name, not by the order of calls: a further stage changes no other
draw, and neither does the number of workers.
"""

import hashlib
from collections.abc import Callable

import numpy as np

RngOf = Callable[..., np.random.Generator]


def seed_of(seed: int, *names: str | int) -> np.random.SeedSequence:
    """Return the child of `seed` for `names`.

    The child's spawn key is the SHA-256 of the names, so distinct names give independent streams
    up to collisions of 128 bits.
    """
    path = "\x1f".join(f"{type(name).__name__}:{name}" for name in names)
    digest = hashlib.sha256(path.encode()).digest()
    words = np.frombuffer(digest[:16], dtype="<u4")
    return np.random.SeedSequence(seed, spawn_key=tuple(int(word) for word in words))


def stream(seed: int, *names: str | int) -> np.random.Generator:
    """Return a generator (PCG64) for the stream of `names`."""
    return np.random.Generator(np.random.PCG64(seed_of(seed, *names)))


def streams(seed: int, *names: str | int) -> RngOf:
    """Return a function from further names to their generators, below `names`."""

    def rng_of(*further: str | int) -> np.random.Generator:
        return stream(seed, *names, *further)

    return rng_of
