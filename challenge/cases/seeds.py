"""Named random streams of a case: adding one shifts no other."""

import hashlib

import numpy as np


def child(seed: int, *name: str) -> np.random.Generator:
    """Return the generator of one named purpose."""
    digest = hashlib.sha256("/".join(name).encode()).digest()
    words = [int.from_bytes(digest[i : i + 4], "little") for i in range(0, 16, 4)]
    return np.random.default_rng(np.random.SeedSequence([seed, *words]))


def number(seed: int, *name: str) -> int:
    """Return a 31-bit number of one named purpose."""
    return int(child(seed, *name).integers(2**31))


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number whose logarithm is uniform between two bounds."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))
