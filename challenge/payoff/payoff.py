"""`challenge payoff`: every world's trial, then the page; continues where it was stopped."""

import json
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from pathlib import Path
from typing import Any

from challenge.cases.seeds import number
from challenge.payoff.gap import Outcome, counted, outcome, pooled
from challenge.payoff.trial import SMALL, Effort, render, run_world
from challenge.payoff.worlds import WORLDS
from challenge.sets.draw import entropy
from challenge.sets.sealed import write_whole

CONTROL = "nothing"


def payoff(
    out: Path, *, seed: int | None, jobs: int, small: bool = False, worlds: list[str] | None = None
) -> dict[str, Any]:
    """Render and seal all worlds, then diagnose, simulate, train and score each.

    Parameters
    ----------
    out
        Folder; what is in there already isn't made again.
    seed
        Master seed; by default the operating system's entropy.
    worlds
        Names out of `WORLDS`; all by default.

    Returns
    -------
    dict
        What `results` returns.

    Raises
    ------
    ValueError
        Where the folder was made with another seed, effort or choice of worlds.
    """
    names = worlds if worlds else list(WORLDS)
    unknown = sorted(set(names) - set(WORLDS))
    if unknown:
        allowed = ", ".join(WORLDS)
        raise ValueError(f"--world: unknown, got {', '.join(unknown)}; allowed: {allowed}")
    effort = SMALL if small else Effort()
    out.mkdir(parents=True, exist_ok=True)
    plan_file = out / "plan.json"
    if plan_file.exists():
        plan = json.loads(plan_file.read_text())
        same = plan["effort"] == asdict(effort) and plan["worlds"] == names
        if not same or seed not in (None, plan["seed"]):
            raise ValueError(f"{out} holds a run with another seed or plan; choose another folder")
    else:
        plan = {
            "seed": entropy() if seed is None else seed, "effort": asdict(effort), "worlds": names,
        }  # fmt: skip
        write_whole(plan_file, json.dumps(plan, indent=1).encode())
    master = {name: number(plan["seed"], "world", name) for name in names}
    # all tests are sealed before the first diagnosis
    for step in (render, run_world):
        work = [(name, master[name], effort, out) for name in names]
        if jobs == 1:
            done = [_call(step, *each) for each in work]
        else:
            with ProcessPoolExecutor(jobs) as pool:
                done = list(pool.map(_call, [step] * len(work), *zip(*work, strict=True)))
        if step is render:
            sealed = json.dumps(dict(zip(names, done, strict=True)), indent=1)
            write_whole(out / "commitments.json", sealed.encode())
            print(f"commitments: {out / 'commitments.json'}", file=sys.stderr, flush=True)
    return results(out)


def _call(step: Any, name: str, seed: int, effort: Effort, out: Path) -> Any:
    return step(name, seed, effort, out)


def results(out: Path) -> dict[str, Any]:
    """Read a finished run.

    Returns
    -------
    dict
        ``plan``; ``answers``: world -> verdict and effects; ``points`` and ``flaws``: world ->
        Outcome, with the mean of all but the control under ``all``.
    """
    plan = json.loads((out / "plan.json").read_text())
    found: dict[str, Any] = {"plan": plan, "answers": {}}
    for name in plan["worlds"]:
        answer = out / name / "diagnose" / "answer.json"
        found["answers"][name] = json.loads(answer.read_text())
    for what in ("points", "flaws"):
        each: dict[str, Outcome] = {
            name: outcome(counted(out / name / "tallies.npz", what), number(plan["seed"], name))
            for name in plan["worlds"]
        }
        missing = [o for name, o in each.items() if name != CONTROL]
        if missing:
            each["all"] = pooled(missing)
        found[what] = each
    return found
