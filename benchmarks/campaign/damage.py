"""Damage to finished datasets, and runs that are killed: nothing may stay unseen or be lost."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from benchmarks.campaign.sandbox import Outcome
from pipeline.dataset.checksums import NAME, own_files
from pipeline.dataset.verify import verify
from sensors.typed_yaml import RecipeError
from tests.support.small_recipe import write_shards


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
    """Kill a run at random moments until it ends; compare every file with the reference's."""
    recipe = write_shards(folder)
    out = folder / "out"
    command = [sys.executable, "-m", "flawforge.cli", "generate", str(recipe), "--out", str(out),
               "--jobs", str(jobs)]  # fmt: skip
    start = time.monotonic()
    kills = 0
    for _ in range(6):
        process = subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
        )
        try:
            process.wait(float(rng.uniform(0.3, 4.0)))
            break
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            kills += 1
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    fault = "" if done.returncode == 0 else "exit code"
    wanted = {name: (reference / name).read_bytes() for name in own_files(reference)}
    found = {name: (out / name).read_bytes() for name in own_files(out)}
    unlike = sorted(name for name in wanted.keys() | found.keys()
                    if wanted.get(name) != found.get(name))  # fmt: skip
    if not fault and unlike:
        fault = "lost"
    shutil.rmtree(out, ignore_errors=True)
    return Outcome(
        fault=fault, code=kills, seconds=time.monotonic() - start,
        words=f"{kills} kills; {', '.join(unlike) or 'the same bytes'} {done.stderr[-200:]}",
    )  # fmt: skip
