"""Mutations: of bytes, of text, and of values in nested data."""

import copy
from typing import Any

import numpy as np

NASTY: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 2**31, 2**63, 2**64, 10**30, -(10**400), 0.0, -0.0, 1e-320,
    1e308,
    float("inf"), float("-inf"), float("nan"), "", " ", "x", "1e400", "../../etc/passwd",
    "/dev/zero", "\u0000", "\ud800", "é" * 300, "!!timestamp 2001-01-01", [], {}, [[]],
    [1, 2, 3], {"a": 1},
    {"uniform": [0, 1000]}, {"uniform": [5, 1]}, {"choice": []}, {"normal": [0, 1]}, {"x": None},
    "2001-12-14t21:59:43.10-05:00", b"\x00\xff",
)  # fmt: skip
LINES = (
    "a: &a [x, x, x, x, x, x, x, x, x]\nb: &b [*a, *a, *a, *a, *a, *a, *a, *a, *a]\n"
    "c: &c [*b, *b, *b, *b, *b, *b, *b, *b, *b]\nd: &d [*c, *c, *c, *c, *c, *c, *c, *c, *c]\n"
    "e: &e [*d, *d, *d, *d, *d, *d, *d, *d, *d]\nf: &f [*e, *e, *e, *e, *e, *e, *e, *e, *e]\n"
    "g: &g [*f, *f, *f, *f, *f, *f, *f, *f, *f]\nh: [*g, *g, *g, *g, *g, *g, *g, *g, *g]\n",
    "? [a, b]\n: c\n", "<<: {seed: 1}\n", "name: !!python/object/apply:os.system [ls]\n",
    "seed: " + "9" * 6000 + "\n", "x: !!timestamp '2001-01-01'\n", "x: !!binary abc\n",
    "%YAML 9.9\n---\n",
    "[" * 3000, "{a: " * 2000, "\t- x\n", "---\na: 1\n---\nb: 2\n", "x: 2001-01-01\n", "x: 1:30\n",
)  # fmt: skip
COUNTS = (
    b"0", b"-1", b"1", b"2147483647", b"4294967296", b"999999999999999", b"1e400", b"nan", b"x",
)  # fmt: skip


def of_bytes(blob: bytes, rng: np.random.Generator) -> bytes:
    """Flip, cut, repeat, insert or zero some bytes."""
    data = bytearray(blob)
    for _ in range(int(rng.integers(1, 4))):
        if not data:
            break
        at = int(rng.integers(len(data)))
        size = int(min(rng.integers(1, 64), len(data) - at))
        way = int(rng.integers(8))
        if way == 0:
            data[at] ^= 1 << int(rng.integers(8))
        elif way == 1:
            del data[at:]
        elif way == 2:
            data[at : at + size] = rng.bytes(size)
        elif way == 3:
            data[at:at] = data[at : at + size] * int(rng.integers(1, 5))
        elif way == 4:
            data[at : at + size] = bytes(size)
        elif way == 5:
            data[at : at + size] = b"\xff" * size
        elif way == 6:
            del data[at : at + size]
        else:
            _number(data, rng)
    return bytes(data)


def _number(data: bytearray, rng: np.random.Generator) -> None:
    """Replace a run of digits by another count: headers announce sizes as text."""
    import re

    runs = [found.span() for found in re.finditer(rb"\d+", bytes(data[:4096]))]
    if runs:
        first, last = runs[int(rng.integers(len(runs)))]
        data[first:last] = COUNTS[int(rng.integers(len(COUNTS)))]


def of_data(data: Any, rng: np.random.Generator) -> Any:
    """Replace, delete, double or rename values in nested data."""
    data = copy.deepcopy(data)
    for _ in range(int(rng.integers(1, 3))):
        places = list(_places(data))
        if not places:
            return data
        holder, key = places[int(rng.integers(len(places)))]
        way = int(rng.integers(5))
        nasty = NASTY[int(rng.integers(len(NASTY)))]
        if way == 0 and isinstance(holder, dict):
            del holder[key]
        elif way == 1 and isinstance(holder, dict):
            holder[f"{key}x"] = holder[key]
        elif way == 2 and isinstance(holder[key], (int, float)) and not isinstance(
            holder[key], bool
        ):  # fmt: skip
            holder[key] = holder[key] * float(10.0 ** rng.integers(-9, 10)) * rng.choice([-1, 1])
        else:
            holder[key] = nasty
    return data


def _places(data: Any) -> Any:
    items = data.items() if isinstance(data, dict) else enumerate(data)
    for key, value in list(items):
        yield data, key
        if isinstance(value, (dict, list)):
            yield from _places(value)
