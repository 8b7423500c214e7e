"""The table of docs/reliability.md."""

from collections import Counter
from pathlib import Path

from benchmarks.campaign.sandbox import Outcome

BEGIN, END = "<!-- campaign -->", "<!-- end of campaign -->"
WORDS = {
    "recipes": "mutated recipes, sensors and surfaces, generated",
    "inputs": "mutated inputs to import, roughness, diagnose",
    "meshes": "meshes: shipped by libraries, public, mutated",
    "flips": "bits flipped, files cut, removed, added, swapped in a finished dataset",
    "kills": "kills (`kill -9`) of runs with one and two jobs",
}


def table(page: Path, results: dict[str, list[Outcome]], seed: int) -> None:
    """Put the figures of a run into the page, between its marks."""
    lines = [
        f"Seed {seed}. Limits: 60 s and 4 GiB a case.",
        "",
        "| cases | number | ended well | what went wrong | longest, s |",
        "| --- | --- | --- | --- | --- |",
    ]
    for kind, found in results.items():
        faults = Counter(outcome.fault for outcome in found if outcome.fault)
        number = sum(outcome.code for outcome in found) if kind == "kills" else len(found)
        well = len(found) - sum(faults.values())
        words = ", ".join(f"{count} {fault}" for fault, count in faults.items()) or "nothing"
        longest = max((outcome.seconds for outcome in found), default=0.0)
        runs = f" (in {len(found)} runs)" if kind == "kills" else ""
        lines.append(f"| {WORDS[kind]} | {number}{runs} | {well} | {words} | {longest:.0f} |")
    text = page.read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    page.write_text(f"{before}{BEGIN}\n" + "\n".join(lines) + f"\n{END}{after}", encoding="utf-8")
