"""True regions of an opened set, drawn again from its keys, and what a perfect answer would score.

A key holds the region that was found when it was sealed. Drawn again with the same speckle it is
what would be sealed today: where that differs, the judge has been mended since. It comes of a few
draws and holds speckle, too: as many further draws of the same case make another, and their
overlap is what an answer could reach that is as good as the judge.
"""

import io
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from challenge.cases.case import Secret, stage
from challenge.cases.truth import DRAWS, redraw
from challenge.judging.score import has_place
from challenge.second.case import stage as second_stage
from challenge.second.truth import redraw as second_redraw
from challenge.sets.processes import in_processes
from challenge.sets.sealed import MESHES, write_whole

KEPT = "regions"
Mask = NDArray[np.bool_]


def draw_again(out: Path, *, jobs: int) -> int:
    """Draw the region of each case whose place is judged; goes on where it stopped.

    Parameters
    ----------
    out : folder of the set, all of whose cases were answered; gets ``regions/``
    """
    (out / KEPT).mkdir(exist_ok=True)
    todo = [name for name in _placed(out) if not _file(out, name).exists()]
    print(f"{len(todo)} regions to draw", flush=True)
    calls = [(str(out), name) for name in todo]
    for k, (_, name) in enumerate(in_processes(_draw_one, calls, jobs)):
        print(f"{name} ({k + 1} of {len(todo)})", flush=True)
    return 0


def drawn_again(out: Path) -> dict[str, tuple[Mask, Mask]]:
    """Return each judged case's region and that of further draws; none where none were drawn.

    Raises
    ------
    ValueError
        Where some are missing.
    """
    if not (out / KEPT).exists():
        return {}
    names = list(_placed(out))
    missing = [name for name in names if not _file(out, name).exists()]
    if missing:
        raise ValueError(
            f"{out / KEPT} lacks {len(missing)} of {len(names)} cases, {missing[0]} first: "
            "run `challenge regions` again"
        )
    found = {}
    for name in names:
        with np.load(_file(out, name)) as kept:
            found[name] = kept["region"], kept["other"]
    return found


def _placed(out: Path) -> Iterator[str]:
    """Names of the cases that have maps and a place of their own."""
    for key in sorted((out / "keys").glob("*.key.json")):
        name = key.name.removesuffix(".key.json")
        if (out / "keys" / f"{name}.npz").exists() and has_place(_secret(out, name)):
            yield name


def _secret(out: Path, name: str) -> dict[str, Any]:
    opened = json.loads((out / "keys" / f"{name}.key.json").read_bytes())
    return dict(opened["secret"])


def _file(out: Path, name: str) -> Path:
    return out / KEPT / f"{name}.npz"


def _draw_one(root: str, name: str) -> None:
    out = Path(root)
    case = Secret.of_key(_secret(out, name))
    if case.family == "second":
        drawn = second_redraw(second_stage(case, out / MESHES), case, range(2 * DRAWS))
    else:
        drawn = redraw(stage(case), case, range(2 * DRAWS))
    first, second = (
        replace(drawn, with_it=drawn.with_it[these], without=drawn.without[these]).region()
        for these in (slice(DRAWS), slice(DRAWS, None))
    )
    maps = io.BytesIO()
    np.savez_compressed(maps, region=first, other=second)
    write_whole(_file(out, name), maps.getvalue())
