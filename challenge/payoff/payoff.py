"""`challenge payoff`: every world's trial, then the page; continues where it was stopped."""

import json
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from pathlib import Path
from typing import Any

from challenge.cases.seeds import number
from challenge.commit import commit
from challenge.payoff.family import CONTROL
from challenge.payoff.gap import KINDS, Outcome, counted, outcome, pooled
from challenge.payoff.trial import FAMILIES, SMALL, Effort, render, run_world
from challenge.sets.draw import entropy
from challenge.sets.sealed import write_whole


def payoff(
    out: Path, *, seed: int | None, jobs: int, small: bool = False,
    worlds: list[str] | None = None, family: str = "first", effort: Effort | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Render and seal all worlds, then diagnose, simulate, train and score each.

    Parameters
    ----------
    out
        Folder; what is in there already isn't made again.
    seed
        Master seed; by default the operating system's entropy.
    worlds
        Names out of the family's `WORLDS`; all by default.
    family
        A name of `FAMILIES`.
    effort
        How much is made, unless `small`.

    Returns
    -------
    dict
        What `results` returns.

    Raises
    ------
    ValueError
        Where the folder was made with another seed, effort or choice of worlds.
    """
    if family not in FAMILIES:
        allowed = ", ".join(FAMILIES)
        raise ValueError(f"--family: unknown, got {family}; allowed: {allowed}")
    every = FAMILIES[family].WORLDS
    names = worlds if worlds else list(every)
    unknown = sorted(set(names) - set(every))
    if unknown:
        allowed = ", ".join(every)
        raise ValueError(f"--world: unknown, got {', '.join(unknown)}; allowed: {allowed}")
    effort = SMALL if small else effort or Effort()
    out.mkdir(parents=True, exist_ok=True)
    plan_file = out / "plan.json"
    if plan_file.exists():
        plan = json.loads(plan_file.read_text())
        same = (plan["effort"], plan["worlds"], plan["family"]) == (asdict(effort), names, family)
        if not same or seed not in (None, plan["seed"]):
            raise ValueError(f"{out} holds a run with another seed or plan; choose another folder")
    else:
        plan = {
            "seed": entropy() if seed is None else seed, "effort": asdict(effort), "worlds": names,
            "family": family, "commit": commit(),
        }  # fmt: skip
        write_whole(plan_file, json.dumps(plan, indent=1).encode())
    master = {name: number(plan["seed"], "world", name) for name in names}
    # all tests are sealed before the first diagnosis
    for step in (render, run_world):
        work = [(family, name, master[name], effort, out) for name in names]
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


def _call(step: Any, family: str, name: str, seed: int, effort: Effort, out: Path) -> Any:
    return step(family, name, seed, effort, out)


def results(out: Path) -> dict[str, Any]:
    """Read a run; worlds that have no tallies yet are left out.

    Returns
    -------
    dict
        ``plan``, with the finished worlds; ``unfinished``: the others; ``answers``: world ->
        verdict and effects; ``outcomes``: segmenter, and points or
        flaws -> world -> Outcome, with the mean of all but the control under ``all``.
    """
    plan = json.loads((out / "plan.json").read_text())
    done = [name for name in plan["worlds"] if (out / name / "tallies.npz").exists()]
    left = [name for name in plan["worlds"] if name not in done]
    plan["worlds"] = done
    found: dict[str, Any] = {"plan": plan, "unfinished": left, "answers": {}, "outcomes": {}}
    for name in plan["worlds"]:
        answer = out / name / "diagnose" / "answer.json"
        found["answers"][name] = json.loads(answer.read_text())
    for kind in KINDS:
        for what in ("points", "flaws"):
            each: dict[str, Outcome] = {
                name: outcome(
                    counted(out / name / "tallies.npz", kind, what), number(plan["seed"], name)
                )
                for name in plan["worlds"]
            }
            missing = [o for name, o in each.items() if name != CONTROL]
            if missing:
                each["all"] = pooled(missing)
            found["outcomes"][kind, what] = each
    return found
