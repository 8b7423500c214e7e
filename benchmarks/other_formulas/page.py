"""docs/diagnosis-bench.md: what the bench of other formulas found, by population."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from benchmarks.other_formulas.cases import POPULATIONS
from benchmarks.other_formulas.formulas import CATALOGUED, OUTSIDE
from benchmarks.other_formulas.judge import Answer, by_effect, figures, load, stated
from benchmarks.other_formulas.parts import PARTS
from benchmarks.other_formulas.run import committed_s
from challenge.judging.probabilities import reliability

_INTRO = """# Bench of other formulas

Made by `make diagnose-bench`. Each effect of the catalogue is made by two formulas that are not
the catalogue's, by a generator that shares neither effects nor noise with the simulator. The
sensor's file leaves out half of its optional keys. Speckle is correlated, negatively between
profiles, and known exactly; so the signal to noise of a case (whitened, pose projected out, edges
included) is a closed calculation, and each case is scaled to 6, 12 or 24 over its fitted
recordings. At an edge a reading counts as one outlier at most, and as less where a shift of the
edge by 30 µm would move it.
"""
_RULES = """
A set is a reported name with its alternatives. Recall counts a hidden effect that some set holds;
precision counts sets that hold a hidden effect, each effect once. A habit is a formula that the
baselines have as well: nothing has changed, and silence is right. A sample is the first cases of a
seed's plan, which has all kinds in proportion. Calibration seeds (0-99) may be opened by anybody.
Validation (100-199) and test (200-299) are judged in aggregate; no case of the test is printed.
Commits before af8979d scaled cases with the sensor's seat projected out in place of the part's:
what looks like a tilt of the part along the travel (drifts, bends) had less signal than stated.
"""


def names_used() -> list[str]:
    """Say which formulas and parts there are."""
    lines = ["## Formulas", "", "| effect | formulas |", "| --- | --- |"]
    for effect in dict.fromkeys(f.effect for f in CATALOGUED):
        names = [f.name for f in CATALOGUED if f.effect == effect]
        lines.append(f"| {effect} | {', '.join(names)} |")
    lines += [
        f"| outside the catalogue | {', '.join(f.name for f in OUTSIDE)} |", "",
        f"Parts: {', '.join(PARTS)}; drawn anew for each case.", "",
    ]  # fmt: skip
    return lines


def section(title: str, answers: Sequence[Answer], opened: bool) -> list[str]:
    """Write the tables of one population."""
    used = any(a.run["baselines_used"] for a in answers)
    lines = [
        f"## {title}", "",
        f"{len(answers)} cases, the first of the seed's plan."
        + ("" if used else " This version knows no baselines: they were not used."), "",
        "| figure | value (of; 95 % interval) | aim |", "| --- | --- | --- |",
        *(f"| {a} | {b} | {c} |" for a, b, c in figures(answers)), "",
    ]  # fmt: skip
    curve = reliability(stated(answers))
    if curve:
        lines += ["| stated probability | share right | names |", "| --- | --- | --- |"]
        lines += [f"| {p:.2f} | {share:.2f} | {n} |" for p, share, n in curve] + [""]
    if opened:
        lines += ["| effect | found, all strengths | wrong sets |", "| --- | --- | --- |"]
        lines += [f"| {a} | {b} | {c} |" for a, b, c in by_effect(answers)] + [""]
    return lines


def population_of(seed: int) -> str:
    """Name the population that a seed belongs to.

    Raises
    ------
    ValueError
        Where it belongs to none.
    """
    for name, seeds in POPULATIONS.items():
        if seed in seeds:
            return name
    raise ValueError(f"seed {seed} belongs to no population; allowed: 0 to 299")


def cases_of(answers: Sequence[Answer]) -> list[str]:
    """One line a case, for populations that may be opened."""
    lines = []
    for a in answers:
        t = a.truth
        said = "; ".join("/".join(names) for names in a.sets) or "-"
        lines.append(
            f"{t['name']}: {', '.join(t['formulas']) or 'nothing'} on {t['part']}, wanted "
            f"{t['wanted']}{'' if t['baselines'] else ', no baselines'} -> {a.verdict}: {said}"
        )
    return lines


def newest_first(folders: Iterable[Path]) -> list[Path]:
    """Sort folders COMMIT/seed-N: newest commit first, in each the opened calibration last."""
    when_s: dict[str, float] = {}

    def place(folder: Path) -> tuple[float, str, bool, int]:
        commit, seed = folder.parent.name, _seed_of(folder)
        if commit not in when_s:
            when_s[commit] = committed_s(commit)
        return -when_s[commit], commit, population_of(seed) == "calibration", seed

    return sorted(folders, key=place)


def _seed_of(folder: Path) -> int:
    return int(folder.name.removeprefix("seed-"))


def write_page(root: Path, file: Path) -> None:
    """Write the page from all answers stored below a folder."""
    lines = [_INTRO, *names_used(), "## Rules", _RULES]
    for folder in newest_first(root.glob("*/seed-*")):
        population = population_of(_seed_of(folder))
        answers = load(folder)
        if answers:
            opened = population == "calibration"
            title = (
                f"{population.capitalize()}, seed {_seed_of(folder)}, commit {folder.parent.name}"
            )
            lines += section(title, answers, opened)
    file.write_text("\n".join(lines).rstrip() + "\n", encoding="utf-8")
