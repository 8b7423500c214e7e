"""Damage to finished datasets, and runs that are killed: nothing may stay unseen or be lost."""

import os
import signal
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.campaign.sandbox import Outcome, run, started
from files.errors import RecipeError
from pipeline.dataset.checksums import NAME, own_files
from pipeline.dataset.verify import verify
from tests.support.small_recipe import write_shards

LONGEST_S = {1: 1.0, 2: 8.0}
"""Until a kill, by jobs: what a run takes on a busy machine; a second process starts slowly."""


def flip(dataset: Path, rng: np.random.Generator) -> Outcome:
    """Flip a bit, cut, swap, remove or add a file; put it back; say whether it was noticed."""
    names = [*own_files(dataset), NAME]
    name = str(rng.choice(names))
    path = dataset / name
    before = path.read_bytes()
    way = rng.uniform()
    start = time.monotonic()
    added = None
    other = None
    if way < 0.85:
        data = bytearray(before)
        data[int(rng.integers(len(data)))] ^= 1 << int(rng.integers(8))
        path.write_bytes(bytes(data))
        words = f"{name}: one bit"
    elif way < 0.9:
        path.write_bytes(before[: int(rng.integers(len(before)))])
        words = f"{name}: truncated"
    elif way < 0.94:
        path.unlink()
        words = f"{name}: removed"
    elif way < 0.97:
        added = dataset / "shard-00777.h5"
        added.write_bytes(before)
        words = "shard-00777.h5: added"
    else:
        other = dataset / str(rng.choice([one for one in names if one != name]))
        kept = other.read_bytes()
        path.write_bytes(kept)
        other.write_bytes(before)
        words = f"{name} and {other.name}: swapped"
    try:
        report = verify(dataset)
        noticed = report.wrong > 0
        said = report.lines[0]
    except RecipeError as error:
        noticed, said = True, str(error)
    except Exception as error:
        noticed, said = False, repr(error)
    if other is not None:
        other.write_bytes(kept)
    if added is not None:
        added.unlink()
    path.write_bytes(before)
    if words.endswith("swapped") and kept == before:
        noticed = True  # two equal files
    fault = "" if noticed else "missed"
    return Outcome(
        fault=fault, code=0, seconds=time.monotonic() - start, words=f"{words} -> {said}"
    )


def killed(folder: Path, reference: Path, rng: np.random.Generator, jobs: int) -> Outcome:
    """Kill a run at random moments; let it end; compare every file with the reference's."""
    recipe = write_shards(folder)
    out = folder / "out"
    words = ["generate", str(recipe), "--out", str(out), "--jobs", str(jobs)]
    kills = 0
    with tempfile.TemporaryFile() as said:
        for _ in range(6):
            process = started(words, folder, said.fileno())
            process.join(float(rng.uniform(0.0, LONGEST_S[jobs])))
            if not process.is_alive():
                break
            try:
                os.killpg(process.pid or 0, signal.SIGKILL)
            except ProcessLookupError:  # before it had a group of its own
                process.kill()
            process.join()
            kills += 1
    done = run(words, folder)
    wanted = {name: (reference / name).read_bytes() for name in own_files(reference)}
    found = {name: (out / name).read_bytes() for name in own_files(out)}
    unlike = sorted(name for name in wanted.keys() | found.keys()
                    if wanted.get(name) != found.get(name))  # fmt: skip
    fault = done.fault or ("exit code" if done.code else "lost" if unlike else "")
    return Outcome(
        fault=fault, code=kills, seconds=done.seconds,
        words=f"{kills} kills; {', '.join(unlike) or 'the same bytes'} {done.words[-200:]}",
    )  # fmt: skip
