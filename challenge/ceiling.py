"""What a perfect answer's region would score: the truth against itself, with other speckle.

A true region comes of a few draws, so it holds speckle, too. Four further draws of the same case
make another; their overlap is what an answer could reach that is as good as the judge.
"""

import json
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from challenge.cases.case import Secret, stage
from challenge.cases.truth import DRAWS, redraw
from challenge.score import judge_case
from challenge.sealed import write_whole

KEPT = "ceiling.json"


def ceiling(out: Path, *, jobs: int) -> int:
    """Measure it for each case of an opened set whose region is judged; goes on where it stopped.

    Parameters
    ----------
    out : folder of the set; gets ``ceiling.json``
    """
    file = out / KEPT
    found: dict[str, float] = json.loads(file.read_text()) if file.exists() else {}
    keys = sorted((out / "keys").glob("*.key.json"))
    names = (k.name.removesuffix(".key.json") for k in keys)
    todo = [n for n in names if n not in found]
    print(f"{len(todo)} keys to look at", flush=True)
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        waiting = {pool.submit(_overlap, str(out), name): name for name in todo}
        for k, ready in enumerate(as_completed(waiting)):
            found[waiting[ready]] = ready.result()
            write_whole(file, json.dumps(found, indent=1).encode())
            print(f"{waiting[ready]} ({k + 1} of {len(todo)})", flush=True)
    return 0


def _overlap(out: str, name: str) -> float:
    """Overlap of a case's region with that of further draws; NaN where none is judged."""
    keys = Path(out) / "keys"
    opened: dict[str, Any] = json.loads((keys / f"{name}.key.json").read_bytes())
    if not (keys / f"{name}.npz").exists():
        return float("nan")
    region = np.load(keys / f"{name}.npz")["region"]
    secret = opened["secret"]
    if not np.isfinite(judge_case(secret, opened["facts"], None, None, region, 0.0).iou):
        return float("nan")
    case = Secret.of_key(secret)
    other = redraw(stage(case), case, range(DRAWS, 2 * DRAWS)).region()
    return judge_case(secret, opened["facts"], None, other, region, 0.0).iou
