"""Where users wait: carving, the disk, the first run, a picture, a check, a scan read back.

`python -m benchmarks --only waits` writes its section of docs/benchmarks.md. Seconds are processor
time, all threads', so that other work on the machine counts little; ways that are compared take
turns within one run.
"""

import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Final, get_args

import h5py
import numpy as np
from numpy.typing import NDArray

import flawforge.dataset
from benchmarks.end_to_end import HOME
from defects.carving.block import Block
from defects.carving.booleans import BooleanError
from defects.carving.solid import Cutter
from defects.surface.surface import Surface
from pipeline.batch.backend import THREADS
from pipeline.dataset.chunks import deflated
from pipeline.dataset.compression import Compression, filters
from pipeline.injection import inject as injection
from pipeline.injection.flawplan import FlawPlan
from pipeline.parts import builtin
from pipeline.seeds import streams

FLAWS: Final = {
    "min_distance_mm": 10,
    "dent": {"number": 3, "length_mm": {"uniform": [15, 30]}, "depth_mm": {"uniform": [0.4, 1.0]}},
    "scratch": {"number": 2, "length_mm": {"uniform": [20, 50]}},
    "crack": 1,
    "bump": 1,
}
PARTS: Final = (
    ("steel_plate", 10.0), ("bearing_cap", 10.0), ("car_door", 80.0), ("car_door", 10.0)
)  # fmt: skip
SHAPE: Final = (1000, 4096)  # of the images that are packed
ROWS: Final = 64  # of a chunk
READ: Final = (200, 512)  # size of the scans that are read back
LOADED: Final = (240, 512)  # of those that a loader takes


@dataclass(frozen=True, kw_only=True, slots=True)
class Carving:
    """Seven flaws drawn and carved into a part, and the same cutters in all ways.

    By their seams in the faces around them, by their whole solids there, and in the whole part.
    """

    part: str
    triangles: int
    all_s: float
    seams_s: float
    local_s: float
    whole_s: float


@dataclass(frozen=True, kw_only=True, slots=True)
class Packing:
    """One image written and read back; `share` of the size that HDF5's own zlib makes."""

    image: str
    way: str
    write_s: float
    read_s: float
    share: float


@dataclass(frozen=True, kw_only=True, slots=True)
class Use:
    """Something that a user waits for, as measured, and the aim."""

    what: str
    measured: str
    aim: str


class WholeBlock(Block):
    """A part that is carved as a whole, always."""

    def _around(self, box_mm: Any) -> Any:
        raise BooleanError("not wanted")


def seconds(run: Callable[[], Any]) -> float:
    """Return processor seconds of a call, all threads'."""
    begin = time.process_time()
    run()
    return time.process_time() - begin


def carvings(rounds: int) -> list[Carving]:
    """Draw and carve seven flaws into each part; and carve the same cutters both ways."""
    plan, rows = FlawPlan.from_mapping(FLAWS), []
    for name, facet_um in PARTS:
        part = builtin.build(name, facet_um)
        local = Block(part.vertices_mm, part.faces)
        whole = WholeBlock(part.vertices_mm, part.faces)
        skin = Surface.of(part.vertices_mm, part.faces)  # once for all specimens of a part
        injection.inject(part, plan, rng_of=streams(rounds, name), surface=skin)  # compiled
        found: dict[str, list[float]] = {"all": [], "seams": [], "local": [], "whole": []}
        for seed in range(rounds):
            begin = time.process_time()
            flawed = injection.inject(part, plan, rng_of=streams(seed, name), surface=skin)
            found["all"].append(time.process_time() - begin)
            solids = [replace(cutter, seam=None) for cutter in flawed.cutters]

            def run(block: Block, cutters: Sequence[Cutter]) -> None:
                block.carve(list(cutters), [block.trial(cutter) for cutter in cutters])

            for key, block, cutters in (
                ("seams", local, flawed.cutters), ("local", local, solids), ("whole", whole, solids)
            ):  # fmt: skip
                found[key].append(seconds(partial(run, block, cutters)))
        middle = {f"{key}_s": statistics.median(values) for key, values in found.items()}
        rows.append(Carving(part=f"{name}, {facet_um:g} µm", triangles=len(part.faces), **middle))
    return rows


def images() -> dict[str, NDArray[Any]]:
    """Return images of counts as shards hold them."""
    rng = np.random.default_rng(1)
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    smooth = 20000 + 6000 * np.sin(x / 900.0) * np.cos(y / 400.0)
    return {
        "depth with noise": (smooth + rng.normal(0, 2.0, SHAPE)).astype(np.uint16),
        "depth without": smooth.astype(np.uint32),
        "mask": ((np.hypot(x - 900, y - 500) < 120) * 3).astype(np.uint8),
    }


def packings(rounds: int) -> list[Packing]:
    """Write each image through HDF5's own zlib and in each compression of a recipe."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.h5"
        for what, image in images().items():
            full = 0
            for way in ("zlib", *get_args(Compression)):

                def write(way: str = way, image: NDArray[Any] = image) -> None:
                    with h5py.File(path, "w", libver="v110") as file:
                        made = file.create_dataset(
                            "x", image.shape, image.dtype, chunks=(ROWS, image.shape[1]),
                            **filters("deflate" if way == "zlib" else way),
                        )  # fmt: skip
                        for first in range(0, len(image), ROWS):
                            part = image[first : first + ROWS]
                            if way == "deflate":
                                made.id.write_direct_chunk((first, 0), deflated(part, ROWS))
                            else:
                                made[first : first + ROWS] = part

                def read() -> None:
                    with h5py.File(path) as file:
                        file["x"][()]

                written = statistics.median(seconds(write) for _ in range(rounds))
                size = path.stat().st_size
                full = full or size
                rows.append(
                    Packing(
                        image=what, way=way, write_s=written, share=size / full,
                        read_s=statistics.median(seconds(read) for _ in range(rounds)),
                    )
                )  # fmt: skip
    return rows


def uses(rounds: int) -> list[Use]:
    """Time the commands and the reader on quickstarts."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        loops = {"NUMBA_CACHE_DIR": str(folder / "loops")}
        first = command("generate", "quickstart", "--out", folder / "first", **loops)
        second = command("generate", "quickstart", "--out", folder / "second", **loops)
        found = [
            Use(
                what="quickstart, 48 scans: first run, then second",
                measured=f"{first:.1f} s, {second:.1f} s",
                aim=f"{2 * second + 10:.1f} s (twice the second and 10 s)",
            )
        ]
        sized = {}
        for profiles, points in (READ, LOADED):
            out = sized[profiles] = folder / f"{profiles}"
            sets = [f"profiles={profiles}", f"points={points}"]
            command("generate", "quickstart", *(x for s in sets for x in ("--set", s)),
                    "--out", out, **loops)  # fmt: skip
        taken = command("preview", sized[200], "--out", folder / "a.png", **loops)
        found.append(Use(what="preview of a scan", measured=f"{taken:.1f} s", aim="2 s"))
        found.append(verified(folder / "large.bin"))
        for fields, said in ((None, "all arrays"), (("depth", "mask"), "depth and mask")):
            each = read_back(sized[200], fields, rounds)
            what = f"a scan of {READ[0]} × {READ[1]} read at random, {said}"
            found.append(Use(what=what, measured=f"{1e3 * each:.1f} ms", aim="5 ms"))
        found += loaded(sized[240])
    return found


def command(*words: Any, **environment: str) -> float:
    """Run a command of ours; return its processor seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        [sys.executable, "-m", "flawforge.cli", *map(str, words)], cwd=HOME, check=True,
        env={**os.environ, **THREADS, **environment}, capture_output=True,
    )  # fmt: skip
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def verified(path: Path) -> Use:
    """Time the checksum that `verify` takes of every file."""
    from pipeline.dataset.shards import file_sha256

    path.write_bytes(np.random.default_rng(0).bytes(1 << 28))
    file_sha256(path)
    rate = path.stat().st_size / seconds(lambda: file_sha256(path)) / 1e9
    return Use(what="verify, a core", measured=f"{rate:.2f} GB/s", aim="1 GB/s")


def read_back(folder: Path, fields: tuple[str, ...] | None, rounds: int) -> float:
    """Return processor seconds of a scan, read in any order."""
    scans = flawforge.dataset.open(folder, fields=fields)
    order = np.random.default_rng(0).permutation(np.tile(np.arange(len(scans)), rounds))
    for one in range(len(scans)):
        scans[one]

    def read() -> None:
        for one in order:
            scans[int(one)]

    return seconds(read) / len(order)


def loaded(folder: Path) -> list[Use]:
    """Time what a worker of torch's DataLoader does for each scan, where torch is installed."""
    try:
        from flawforge.torch import Scans
    except ImportError:
        return []
    found = []
    for channel in ("depth", "relief"):
        scans = Scans(folder, input=channel)
        scans[0]
        each = seconds(lambda scans=scans: [scans[k] for k in range(len(scans))]) / len(scans)
        found.append(
            Use(
                what=f"two workers of a DataLoader, {channel} of {LOADED[0]} × {LOADED[1]}",
                measured=f"{2 / each:.0f} scans/s of processor time", aim="150 scans/s",
            )
        )  # fmt: skip
    return found
