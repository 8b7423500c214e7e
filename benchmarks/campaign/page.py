"""The table of docs/reliability.md, out of the summary that each part of a campaign leaves."""

import json
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from benchmarks.campaign.sandbox import BYTES, SECONDS, Outcome
from challenge.commit import commit

BEGIN, END = "<!-- campaign -->", "<!-- end of campaign -->"
WORDS = {
    "recipes": "mutated recipes, sensors and surfaces, generated",
    "inputs": "mutated inputs to import, roughness, diagnose",
    "meshes": "meshes: shipped by libraries, public, mutated",
    "flips": "bits flipped, files cut, removed, added, swapped in a finished dataset",
    "kills": "kills (`kill -9`) of runs with one and two jobs",
}


def summarise(folder: Path, kind: str, found: Sequence[Outcome], seed: int) -> None:
    """Keep the table's entry for one kind of cases; an earlier summary of the kind goes."""
    facts = {
        "seed": seed, "commit": commit(), "cases": len(found),
        "kills": sum(outcome.code for outcome in found) if kind == "kills" else None,
        "faults": Counter(outcome.fault for outcome in found if outcome.fault),
        "longest_s": max((outcome.seconds for outcome in found), default=0.0),
    }  # fmt: skip
    (folder / f"{kind}.json").write_text(json.dumps(facts) + "\n", encoding="utf-8")


def table(page: Path, folder: Path) -> None:
    """Put the figures of every summary into the page, between its marks."""
    lines = [
        f"Limits: {SECONDS:.0f} s of the processor and {BYTES >> 30} GiB a case.",
        "",
        "| cases | number | ended well | what went wrong | longest, s | seed | commit |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for kind, words in WORDS.items():
        path = folder / f"{kind}.json"
        if not path.exists():
            lines.append(f"| {words} | not run | | | | | |")
            continue
        facts = json.loads(path.read_text(encoding="utf-8"))
        cases, faults = facts["cases"], facts["faults"]
        number = f"{facts['kills']} (in {cases} runs)" if kind == "kills" else cases
        wrong = ", ".join(f"{count} {fault}" for fault, count in faults.items()) or "nothing"
        lines.append(
            f"| {words} | {number} | {cases - sum(faults.values())} | {wrong}"
            f" | {facts['longest_s']:.0f} | {facts['seed']} | {facts['commit']} |"
        )
    text = page.read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    page.write_text(f"{before}{BEGIN}\n" + "\n".join(lines) + f"\n{END}{after}", encoding="utf-8")
