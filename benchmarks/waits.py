"""Where users wait: carving locally against the whole part, ISA-L against HDF5's zlib.

`python -m benchmarks.waits` prints processor seconds and their ratios, both ways in one run.
"""

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from defects.carving.block import Block
from defects.carving.solid import BooleanError
from pipeline.dataset.chunks import deflated
from pipeline.injection import inject as injection
from pipeline.injection.flawplan import FlawPlan
from pipeline.parts import builtin
from pipeline.seeds import streams

FLAWS = {
    "min_distance_mm": 10,
    "dent": {"number": 3, "length_mm": {"uniform": [15, 30]}, "depth_mm": {"uniform": [0.4, 1.0]}},
    "scratch": {"number": 2, "length_mm": {"uniform": [20, 50]}},
    "crack": 1,
    "bump": 1,
}
PARTS = (("steel_plate", 10.0), ("bearing_cap", 10.0), ("car_door", 80.0), ("car_door", 10.0))
SHAPE = (1000, 4096)  # of the images that are deflated
ROWS = 64  # of a chunk


class WholeBlock(Block):
    """A part that is carved as a whole, always."""

    def _around(self, box_mm: Any) -> Any:
        raise BooleanError("not wanted")


def seconds(run: Callable[[], Any]) -> float:
    """Return processor seconds of a call, all threads'."""
    begin = time.process_time()
    run()
    return time.process_time() - begin


def carving(rounds: int) -> None:
    """Print seven flaws' trials and carving, the two ways."""
    plan = FlawPlan.from_mapping(FLAWS)
    for name, facet_um in PARTS:
        part = builtin.build(name, facet_um)
        local = Block(part.vertices_mm, part.faces)
        whole = WholeBlock(part.vertices_mm, part.faces)
        found: dict[str, list[float]] = {"local": [], "whole": []}
        for seed in range(rounds):
            flawed = injection.inject(part, plan, rng_of=streams(seed, name))
            cutters = list(flawed.cutters)

            def run(block: Block, cutters: list[Any] = cutters) -> None:
                block.carve(cutters, [block.trial(cutter) for cutter in cutters])

            for key, block in (("whole", whole), ("local", local)):
                found[key].append(seconds(lambda block=block, run=run: run(block)))
        near, far = (statistics.median(found[key]) for key in ("local", "whole"))
        print(
            f"carving, {name}, {len(part.faces):,} triangles: {near:.3f} s, "
            f"whole part {far:.3f} s, {far / near:.2f} ×",
            flush=True,
        )


def deflating(rounds: int) -> None:
    """Print one image of counts through HDF5's filters and through `deflated`."""
    rng = np.random.default_rng(1)
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    smooth = 20000 + 6000 * np.sin(x / 900.0) * np.cos(y / 400.0)
    images = {
        "depth with noise": (smooth + rng.normal(0, 2.0, SHAPE)).astype(np.uint16),
        "depth without": smooth.astype(np.uint32),
        "mask": ((np.hypot(x - 900, y - 500) < 120) * 3).astype(np.uint8),
    }
    with tempfile.TemporaryDirectory() as folder:
        for what, image in images.items():
            times, sizes = {}, {}
            for key in ("zlib", "isal"):
                path = Path(folder) / f"{key}.h5"

                def write(path: Path = path, key: str = key, image: Any = image) -> None:
                    with h5py.File(path, "w", libver="v110") as file:
                        made = file.create_dataset(
                            "x", image.shape, image.dtype, chunks=(ROWS, image.shape[1]),
                            compression="gzip", compression_opts=1, shuffle=True,
                        )  # fmt: skip
                        for first in range(0, len(image), ROWS):
                            part = image[first : first + ROWS]
                            if key == "zlib":
                                made[first : first + ROWS] = part
                            else:
                                made.id.write_direct_chunk((first, 0), deflated(part, ROWS))

                times[key] = statistics.median(seconds(write) for _ in range(rounds))
                sizes[key] = path.stat().st_size
            print(
                f"writing, {what}: {times['isal']:.3f} s, zlib {times['zlib']:.3f} s, "
                f"{times['zlib'] / times['isal']:.1f} ×; size {sizes['isal'] / sizes['zlib']:.3f}"
            )


def main() -> None:
    """Print all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=3)
    rounds = parser.parse_args().rounds
    deflating(rounds)
    carving(rounds)


if __name__ == "__main__":
    main()
