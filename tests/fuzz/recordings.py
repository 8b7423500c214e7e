"""Recordings as HDF5 can spell them: right ones, and every way of storing something else."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from hypothesis import strategies as st

from sensors.recording import FORMAT
from tests.support.mutation import NASTY

TYPES = ("f2", "f4", ">f8", "i1", "i8", "u8", "?", "c16", "S3", "f4,i4")
STORED = (
    "missing", "group", "empty", "declared", "external", "virtual", "soft link", "external link",
    "text", "dangling",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True, slots=True)
class Entry:
    """An entry of the file: values, their type, and how they are stored."""

    values: np.ndarray
    dtype: str = "f8"
    stored: str = "plain"


@dataclass(frozen=True, kw_only=True, slots=True)
class File:
    """All that is written."""

    entries: Mapping[str, Entry]
    attributes: Mapping[str, Any]


@st.composite
def right(draw: st.DrawFn) -> File:
    """Draw a recording that is one: a plate with gaps, moved along y."""
    rows, columns = draw(st.integers(1, 6)), draw(st.integers(2, 7))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    depth = rng.normal(draw(st.floats(10.0, 500.0)), draw(st.floats(0.0, 5.0)), (rows, columns))
    depth[rng.uniform(size=depth.shape) < draw(st.sampled_from([0.0, 0.5]))] = np.nan
    depth[0, 0] = 100.0
    pose = np.tile(np.eye(4), (rows, 1, 1))
    pose[:, 1, 3] = np.arange(rows)
    entries = {
        "depth": depth, "pose": pose, "time": np.cumsum(rng.uniform(0.0, 1.0, rows)),
        "intensity": rng.uniform(size=depth.shape), "x": np.arange(columns) - 2.0,
        "ray_x": np.arange(columns) * 0.1, "ray_slope": np.zeros(columns),
    }  # fmt: skip
    optional = [("intensity",), ("x",), ("ray_x", "ray_slope")]
    for names in draw(st.lists(st.sampled_from(optional), unique=True)):
        for name in names:
            del entries[name]
    attributes: dict[str, Any] = {"format": FORMAT, "version": 1}
    attributes |= draw(
        st.fixed_dictionaries(
            {},
            optional={
                "name": st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"])),
                "start_time_s": st.floats(-1e9, 1e9),
            },
        )
    )
    return File(entries={k: Entry(values=v) for k, v in entries.items()}, attributes=attributes)


@st.composite
def changed(draw: st.DrawFn) -> File:
    """Draw a recording with one to three of its entries or attributes otherwise."""
    file = draw(right())
    entries, attributes = dict(file.entries), dict(file.attributes)
    for _ in range(draw(st.integers(1, 3))):
        name = draw(st.sampled_from(sorted(entries)))
        entry = entries[name]
        way = draw(st.sampled_from(["dtype", "stored", "shape", "value", "attribute"]))
        if way == "dtype":
            entry = Entry(values=entry.values, dtype=draw(st.sampled_from(TYPES)))
        elif way == "stored":
            entry = Entry(values=entry.values, stored=draw(st.sampled_from(STORED)))
        elif way == "shape":
            shape = draw(st.lists(st.integers(0, 4), max_size=4))
            entry = Entry(values=np.resize(entry.values, shape), dtype=entry.dtype)
        elif way == "value" and entry.values.size:
            values = entry.values.copy()
            place = draw(st.integers(0, values.size - 1))
            nasty = [0.0, -1.0, np.nan, np.inf, -np.inf, 1e308, 1e-320, 1e30]
            values.ravel()[place] = draw(st.sampled_from(nasty))
            entry = Entry(values=values, dtype=entry.dtype)
        else:
            key = draw(st.sampled_from(["format", "version", "name", "comment", "start_time_s",
                                        "import_options"]))  # fmt: skip
            attributes[key] = draw(st.sampled_from(NASTY))
        entries[name] = entry
    return File(entries=entries, attributes=attributes)


def otherwise(name: str, value: float) -> File:
    """Return a small recording with the first number of an entry, or an attribute, otherwise."""
    pose = np.eye(4)[None]
    numbers = {"depth": np.array([[100.0, 10.0]]), "pose": pose, "time": np.zeros(1)}
    attributes: dict[str, Any] = {"format": FORMAT, "version": 1}
    if name in numbers:
        numbers[name].flat[0] = value
    else:
        attributes[name] = value
    return File(entries={k: Entry(values=v) for k, v in numbers.items()}, attributes=attributes)


def write(file: File, path: Path) -> None:
    """Write a file as drawn; what HDF5 itself refuses to hold is left out."""
    other = path.with_name("other.h5")
    if not other.exists():
        with h5py.File(other, "w") as beside:
            beside["depth"] = np.ones((2, 2))
    with h5py.File(path, "w") as stored:
        for name, entry in file.entries.items():
            _write_entry(stored, name, entry, other)
        for key, value in file.attributes.items():
            try:
                stored.attrs[key] = value
            except (TypeError, ValueError, OverflowError, RuntimeError, UnicodeError):
                stored.attrs[key] = repr(value).encode("ascii", "replace")


def _write_entry(stored: h5py.File, name: str, entry: Entry, other: Path) -> None:
    way, shape = entry.stored, entry.values.shape
    if way == "plain":
        kind = np.dtype(entry.dtype)
        known = kind.kind not in "iu" or np.isfinite(entry.values)
        with np.errstate(all="ignore"):
            values = np.where(known, entry.values, 0.0)
            values = np.zeros(shape, kind) if kind.names else values.astype(kind)
        stored.create_dataset(name, data=values)
    elif way == "group":
        stored.create_group(name)["depth"] = 1.0
    elif way == "empty":
        stored[name] = h5py.Empty("f8")
    elif way == "declared":  # a terabyte that nobody wrote
        stored.create_dataset(name, shape=(10**6, 10**6), chunks=(100, 100), dtype="f4")
    elif way == "external":
        where = [(str(other), 0, h5py.h5f.UNLIMITED)]
        stored.create_dataset(name, shape=shape, dtype="f8", external=where)
    elif way == "virtual":
        layout = h5py.VirtualLayout(shape=shape, dtype="f8")
        if entry.values.size:
            layout[...] = h5py.VirtualSource(str(other), "depth", shape=shape)
        stored.create_virtual_dataset(name, layout)
    elif way == "soft link":
        stored[name] = h5py.SoftLink("/pose")
    elif way == "dangling":
        stored[name] = h5py.SoftLink("/nowhere")
    elif way == "external link":
        stored[name] = h5py.ExternalLink(str(other), "/depth")
    elif way == "text":
        stored[name] = "0 1 2"
