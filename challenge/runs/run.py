"""`challenge run`: diagnose each sealed case in a process and a folder that hold no key."""

import functools
import json
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import numpy as np

from challenge.baseline.shuffle import SHUFFLED, shuffle
from challenge.commit import commit
from challenge.runs.measure import CHANGE, WAYS, folder
from challenge.runs.measure import answers as answers_of
from challenge.sets.processes import ONE_CORE
from challenge.sets.sealed import commitments_of, write_whole

KEPT = ("diagnosis.json", "mismatch.h5", "sensor.yaml")


def run(
    out: Path, *, jobs: int, timeout_s: float, shuffled: int = 0, measured: str | None = None
) -> int:
    """Diagnose all cases of a set that have no answer yet.

    Parameters
    ----------
    measured
        Instead, diagnose the cases to which `challenge measure` added a scan, `ranked` or `random`.
    shuffled
        Instead, diagnose the first so many with their covariates shuffled: a baseline.

    Returns
    -------
    int
        0, or 1 when the diagnosis failed on some cases (they count against it).
    """
    names = sorted(commitments_of(out)["cases"])
    answers = out / (SHUFFLED if shuffled else "answers")
    cases = out / "cases"
    if shuffled:
        names = names[:shuffled]
    if measured is not None:
        if measured not in WAYS:
            raise ValueError(f"--measured: unknown, got {measured!r}; allowed: {', '.join(WAYS)}")
        cases, answers = folder(out, measured), answers_of(out, measured)
        names = [name for name in names if (cases / name / CHANGE).exists()]
    answers.mkdir(exist_ok=True)
    todo = [name for name in names if not (answers / name / "run.json").exists()]
    print(f"{len(names)} cases, {len(todo)} to diagnose", flush=True)
    at_work: set[subprocess.Popen[str]] = set()
    stopping = threading.Event()
    with ThreadPoolExecutor(max(jobs, 1)) as pool:
        waiting = {pool.submit(_diagnose, cases, answers, name, timeout_s, at_work, stopping): name
                   for name in todo}  # fmt: skip
        try:
            for k, ready in enumerate(as_completed(waiting)):
                code, seconds = ready.result()
                word = "answered" if code == 0 else f"failed ({code})"
                told = "a case" if measured else waiting[ready]  # the keys know which
                print(f"{told} {word} in {seconds:.0f} s ({k + 1} of {len(todo)})", flush=True)
        except BaseException:
            # interrupted: the diagnoses at work end too, and leave no answer
            stopping.set()
            pool.shutdown(wait=False, cancel_futures=True)
            for process in tuple(at_work):
                process.kill()
            raise
    failed = [n for n in names if _record(answers, n).get("code") != 0]
    if failed:
        which = "" if measured else f": {', '.join(failed)}"
        print(f"no answer for {len(failed)} cases{which}", file=sys.stderr)
    return 1 if failed else 0


def command(
    recordings: list[str], plates: list[str], baselines: Sequence[str] = ()
) -> list[str]:
    """Return the command line of one diagnosis, as a stranger would type it."""
    given = [word for option, names in (("--reference", plates), ("--baseline", baselines))
             if names for word in (option, *names)]  # fmt: skip
    return [
        sys.executable, "-m", "flawforge.cli", "diagnose", *recordings, "--part", "part.stl",
        "--sensor", "sensor.yaml", "--part-unit", "mm", "--out", "diagnosis", *given,
    ]  # fmt: skip


@functools.cache
def accepts_baselines() -> bool:
    """Whether this version's `diagnose` knows --baseline."""
    words = [sys.executable, "-m", "flawforge.cli", "diagnose", "--help"]
    said = subprocess.run(words, capture_output=True, text=True, check=False)
    return "--baseline" in said.stdout


def diagnosed_at(out: Path) -> str:
    """Return the commits of a set's answers; of answers that don't say, the checkout's."""
    here, found = commit(), set()
    for file in sorted((out / "answers").glob("*/run.json")):
        found.add(json.loads(file.read_text()).get("commit", here))
    return ", ".join(sorted(found)) or here


def _record(answers: Path, name: str) -> dict[str, Any]:
    file = answers / name / "run.json"
    return dict(json.loads(file.read_text())) if file.exists() else {}


def _diagnose(
    cases: Path,
    answers: Path,
    name: str,
    timeout_s: float,
    at_work: set[subprocess.Popen[str]],
    stopping: threading.Event,
) -> tuple[int, float]:
    """Copy one case away, diagnose it there, bring the answer back."""
    answer = answers / name
    with tempfile.TemporaryDirectory(prefix="flawforge-case-") as bare:
        here = Path(bare)
        for file in (cases / name).iterdir():
            if file.name == CHANGE:
                continue  # the judge's note
            shutil.copyfile(file, here / file.name)
        if answers.name == SHUFFLED:
            shuffle(here, np.random.default_rng(list(name.encode())))
        recordings = sorted(p.name for p in here.glob("[a-z].h5"))
        plates = sorted(p.name for p in here.glob("plate-*.h5"))
        baselines = sorted(p.name for p in here.glob("base-*.h5")) if accepts_baselines() else []
        begin = time.time()
        process = subprocess.Popen(
            command(recordings, plates, baselines), cwd=here, env={**os.environ, **ONE_CORE},
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        )  # fmt: skip
        at_work.add(process)
        try:
            said, _ = process.communicate(timeout=timeout_s)
            code, tail = process.returncode, said[-2000:]
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
            code, tail = 124, f"stopped after {timeout_s:.0f} s"
        finally:
            at_work.discard(process)
        if stopping.is_set():
            raise InterruptedError(f"{name}: run again to diagnose it")
        seconds = time.time() - begin
        shutil.rmtree(answer, ignore_errors=True)
        answer.mkdir(parents=True)
        for kept in KEPT:
            if (here / "diagnosis" / kept).exists():
                shutil.copyfile(here / "diagnosis" / kept, answer / kept)
    if code == 0 and not (answer / "diagnosis.json").exists():
        code, tail = 3, "no diagnosis.json\n" + tail
    record = {"code": code, "seconds": seconds, "began": begin, "said": tail,
              "commit": commit()}
    write_whole(answer / "run.json", json.dumps(record).encode())
    return code, seconds
