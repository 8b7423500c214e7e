"""Score the answers to the cases of a population, in aggregate."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import beta

from challenge.judging.probabilities import calibration_error, error_by_chance, reliability

STRANGE = ("unexplained", "partly_explained")
CONFIDENT = 0.5
"""A name with more probability than this is one that the diagnosis stands for."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Answer:
    """One case and its answer.

    Attributes
    ----------
    truth, run : as stored
    sets : of names, one for each effect reported: the name and its alternatives
    sure : probability of each reported name, None where the diagnosis gives none
    none_of_these : probability that no name is right, None where none is given
    verdict : None where the diagnosis failed
    """

    truth: dict[str, Any]
    run: dict[str, Any]
    verdict: str | None
    sets: tuple[tuple[str, ...], ...]
    sure: tuple[float | None, ...]
    chances: tuple[tuple[str, float], ...]
    none_of_these: float | None
    parameters: tuple[tuple[str, dict[str, Any]], ...] = ()

    @property
    def known(self) -> tuple[set[str], ...]:
        """For each hidden effect the names that are right."""
        also = self.truth["also"]
        return tuple({n, *a} for n, a in zip(self.truth["effects"], also, strict=True))


def load(folder: Path) -> list[Answer]:
    """Read the stored answers of a seed, in the order of their numbers."""
    out = []
    for kept in sorted(folder.glob("*/run.json"), key=lambda p: p.parent.name.split("-")[1]):
        run = json.loads(kept.read_text())
        if run["code"] is None:  # no such case: no size reaches its signal to noise
            continue
        truth = json.loads((kept.parent / "truth.json").read_text())
        file = kept.parent / "diagnosis.json"
        said = json.loads(file.read_text()) if file.exists() and run["code"] == 0 else None
        out.append(_answer(truth, run, said))
    return out


def _answer(truth: dict[str, Any], run: dict[str, Any], said: dict[str, Any] | None) -> Answer:
    effects = [e for e in (said or {}).get("effects", []) if e["name"] != "empirical"]
    sets, chances = [], []
    for e in effects:
        others = [a for a in e.get("alternatives", []) if a["name"] != "empirical"]
        sets.append(tuple(dict.fromkeys([e["name"], *(a["name"] for a in others)])))
        stated = [x for x in (e, *others) if "probability" in x]
        chances += [(x["name"], float(x["probability"])) for x in stated]
    return Answer(
        truth=truth, run=run, verdict=None if said is None else str(said["verdict"]),
        sets=tuple(sets), sure=tuple(e.get("probability") for e in effects),
        chances=tuple(chances), none_of_these=None if said is None else said.get("none_of_these"),
        parameters=tuple((e["name"], e.get("parameters", {})) for e in effects),
    )  # fmt: skip


def interval(hits: float, of: int) -> tuple[float, float]:
    """Exact 95 % interval of a share (Clopper and Pearson 1934)."""
    low = 0.0 if hits == 0 else float(beta.ppf(0.025, hits, of - hits + 1))
    high = 1.0 if hits == of else float(beta.ppf(0.975, hits + 1, of - hits))
    return low, high


def recall(answers: Sequence[Answer]) -> tuple[float, int]:
    """Hidden effects that some offered set holds; how many were hidden."""
    hits, of = 0, 0
    for a in answers:
        offered = {name for names in a.sets for name in names}
        hits += sum(bool(right & offered) for right in a.known)
        of += len(a.known)
    return hits, of


def precision(answers: Sequence[Answer]) -> tuple[float, int]:
    """Offered sets that hold a hidden effect, each hidden effect once; how many were offered."""
    hits, of = 0, 0
    for a in answers:
        left = list(a.known)
        of += len(a.sets)
        for names in a.sets:
            match = next((right for right in left if right & set(names)), None)
            if match is not None:
                left.remove(match)
                hits += 1
    return hits, of


def first_names(answers: Sequence[Answer]) -> tuple[float, int]:
    """Count reported names (alternatives left aside) that are right, and all of them."""
    right = sum(
        any(names[0] in known for known in a.known) for a in answers for names in a.sets
    )
    return right, sum(len(a.sets) for a in answers)


def alarms(answers: Sequence[Answer]) -> tuple[int, int]:
    """Cases in which something is said to have changed."""
    return sum(a.verdict not in (None, "match") for a in answers), len(answers)


def flagged(answers: Sequence[Answer]) -> tuple[int, int]:
    """Cases outside the catalogue whose verdict says that something is unexplained."""
    return sum(a.verdict in STRANGE for a in answers), len(answers)


def wrongly_sure(answers: Sequence[Answer]) -> tuple[int, int]:
    """Cases outside the catalogue with a name of more than `CONFIDENT`; 1 where none is given."""
    wrong = sum(any((1.0 if p is None else p) > CONFIDENT for p in a.sure) for a in answers)
    return wrong, len(answers)


def stated(answers: Sequence[Answer]) -> list[tuple[float, bool]]:
    """Probability of each name given, and whether the name is right."""
    return [
        (p, any(name in right for right in a.known)) for a in answers for name, p in a.chances
    ]


def coverage(answers: Sequence[Answer]) -> tuple[int, int]:
    """Count 95 % intervals that hold the true parameter, of laws that were named, and all."""
    hits, of = 0, 0
    for a in answers:
        true = a.truth.get("parameters", {})
        for name, stated in a.parameters:
            for key, value in true.get(name, {}).items():
                low, high = (stated.get(key, {}).get(end) for end in ("low", "high"))
                if low is not None and high is not None:
                    hits += low <= value <= high
                    of += 1
    return hits, of


def share(figure: tuple[float, int]) -> str:
    """Write a share with its count and interval."""
    hits, of = figure
    if not of:
        return "- (0)"
    low, high = interval(hits, of)
    return f"{hits / of:.2f} ({hits:g} of {of}; {low:.2f} to {high:.2f})"


def figures(answers: Sequence[Answer]) -> list[tuple[str, str, str]]:
    """Figure, value and aim, in aggregate."""

    def some(kind: str, wanted: int | None = None) -> list[Answer]:
        return [
            a for a in answers
            if a.truth["kind"] == kind and (wanted is None or a.truth["wanted"] == wanted)
        ]  # fmt: skip

    nulls, outside, pairs = some("null"), some("outside"), some("pair")
    rows = [("alarms on nulls", share(alarms(nulls)), "at most 1 of 100")]
    if some("habit"):
        rows.append(("alarms where baselines have the same", share(alarms(some("habit"))), "-"))
    aims = {12: ("0.90", "0.95"), 6: ("0.60", "-"), 24: ("0.90", "-"), 0: ("-", "-")}
    for wanted, (found, pure) in aims.items():
        ones = some("one", wanted)
        if not ones:
            continue
        label = f"signal to noise {wanted}" if wanted else "size given"
        if wanted:
            given = sum(a.truth["baselines"] for a in ones) > len(ones) / 2
            label += " with baselines" if given else " without baselines"
        rows += [
            (f"recall, {label}", share(recall(ones)), found),
            (f"precision of sets, {label}", share(precision(ones)), pure),
            (f"precision of first names, {label}", share(first_names(ones)), "-"),
        ]
    both = sum(recall([a])[0] == 2 for a in pairs)
    sizes = [len(names) for a in answers for names in a.sets]
    named = stated(answers)
    error = f"{calibration_error(reliability(named)):.3f} ({len(named)} names)"
    seconds = np.array([a.run["seconds"] for a in answers]) if answers else np.zeros(1)
    lost = sum(a.verdict is None for a in answers)
    return [
        *rows,
        ("effects of pairs found, each at 12", share(recall(pairs)), "-"),
        ("pairs found whole", share((both, len(pairs))), "-"),
        ("precision of sets on pairs", share(precision(pairs)), "-"),
        ("outside the catalogue, flagged", share(flagged(outside)), "0.90"),
        (f"outside, a name with probability above {CONFIDENT}", share(wrongly_sure(outside)), "0"),
        ("laws found", share(recall(some("law"))), "-"),
        ("coverage of 95 % intervals", share(coverage(answers)), "0.92 to 0.98"),
        ("names in a set, mean", f"{np.mean(sizes):.2f} ({len(sizes)})" if sizes else "-", "-"),
        ("expected calibration error", error if named else "no probabilities", "0.05"),
        ("- of as many names whose probabilities are true, by chance",
         f"{error_by_chance(named):.3f}" if named else "-", "-"),
        ("no answer (counted as missed)", f"{lost} of {len(answers)}", "0"),
        ("processor seconds of a case, median and longest",
         f"{np.median(seconds):.1f}, {seconds.max():.1f}", "longest at most 3 medians"),
    ]  # fmt: skip


def by_effect(answers: Sequence[Answer]) -> list[tuple[str, str, str]]:
    """Effect or kind, recall, and how many wrong sets its cases drew: aggregates of formulas."""
    names = sorted({e for a in answers if a.truth["kind"] == "one" for e in a.truth["effects"]})
    out = []
    for name in names:
        mine = [a for a in answers if a.truth["kind"] == "one" and a.truth["effects"] == [name]]
        hits, of = recall(mine)
        right, offered = precision(mine)
        out.append((name, f"{hits:g} of {of}", f"{offered - right:g}"))
    return out
