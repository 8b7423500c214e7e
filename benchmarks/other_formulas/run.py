"""Diagnose the cases of a seed by the command line; continues where it was stopped."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.other_formulas.cases import PLANS, Case, save_truth, stage, write
from challenge.commit import commit

TIMEOUT_S = 900.0
_COMMAND = (sys.executable, "-W", "ignore", "-m", "flawforge.cli")


def accepts_baselines() -> bool:
    """Whether this checkout's `diagnose` knows --baseline."""
    said = subprocess.run([*_COMMAND, "diagnose", "--help"], capture_output=True, text=True)
    return "--baseline" in said.stdout


def committed_s(name: str) -> float:
    """Return when a commit was made, seconds of the epoch; -inf where git doesn't know it."""
    said = subprocess.run(
        ["git", "show", "--no-patch", "--format=%ct", f"{name.removesuffix('-dirty')}^{{commit}}"],
        capture_output=True, text=True, cwd=Path(__file__).parents[2],
    )  # fmt: skip
    return float(said.stdout) if said.returncode == 0 else -np.inf


def words(folder: Path, out: Path, baselines: bool) -> list[str]:
    """Build the command line for a case's folder."""

    def named(pattern: str) -> list[str]:
        return sorted(str(p) for p in folder.glob(pattern))

    line = [*_COMMAND, "diagnose", *named("rec-*.h5"), "--part", str(folder / "part.stl"),
            "--sensor", str(folder / "sensor.yaml"), "--out", str(out), "--quiet"]  # fmt: skip
    if named("plate*.h5"):
        line += ["--reference", *named("plate*.h5")]
    if baselines and named("base-*.h5"):
        line += ["--baseline", *named("base-*.h5")]
    return line


def run(out: Path, seed: int, first: int | None, minutes: float, plan: str) -> None:
    """Make, diagnose and forget each case of a plan; keep answers and, apart from them, truths."""
    cases = PLANS[plan](seed)[:first]
    began, known = time.monotonic(), accepts_baselines()
    todo = [c for c in cases if not (out / c.name / "run.json").exists()]
    print(f"{len(cases)} cases, {len(todo)} to answer", flush=True)
    for k, case in enumerate(todo):
        if time.monotonic() - began > 60 * minutes:
            print(f"stopped by the clock, {len(todo) - k} left", flush=True)
            return
        _answer(case, out / case.name, known)
    print("all answered", flush=True)


def _answer(case: Case, kept: Path, baselines: bool) -> None:
    kept.mkdir(parents=True, exist_ok=True)
    try:
        staged = stage(case)
    except ValueError as error:
        (kept / "run.json").write_text(json.dumps({"code": None, "reason": str(error)}))
        return
    with tempfile.TemporaryDirectory() as aside:
        folder, found = Path(aside) / "case", Path(aside) / "found"
        save_truth(write(staged, folder), kept / "truth.json")
        record = diagnose(words(folder, found, baselines))
        record |= {"commit": commit(), "baselines_used": baselines and case.baselines}
        if (found / "diagnosis.json").exists():
            shutil.copy(found / "diagnosis.json", kept / "diagnosis.json")
    (kept / "run.json").write_text(json.dumps(record))


def diagnose(line: list[str]) -> dict[str, object]:
    """Run one diagnosis on one thread; return exit code, processor seconds, last words."""
    threads = {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    before, began = os.times(), time.monotonic()
    try:
        done = subprocess.run(
            line, capture_output=True, text=True, timeout=TIMEOUT_S, env={**os.environ, **threads}
        )
        code, last = done.returncode, done.stderr[-300:]
    except subprocess.TimeoutExpired:
        code, last = -1, f"no answer within {TIMEOUT_S:g} s"
    after = os.times()
    spent = after.children_user + after.children_system
    spent -= before.children_user + before.children_system
    return {
        "code": code, "seconds": spent, "wall_seconds": time.monotonic() - began, "stderr": last,
    }  # fmt: skip
