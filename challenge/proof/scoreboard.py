"""The scoreboard of a judged set: figure, value with its count or interval, aim."""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from challenge.judging.probabilities import (
    calibration_error,
    error_by_chance,
    log_score,
    reliability,
    score_by_chance,
    stated,
    stated_strange,
)
from challenge.judging.score import ORACLE_SEES, accepted, clopper_pearson
from challenge.runs.measure import RANDOM, RANKED
from challenge.sets.aims import (
    AIMS,
    ALARMS,
    CONCEALED,
    COVERAGE,
    ERROR,
    IOU,
    PRECISION,
    SHARE,
    TOP_1,
    UNKNOWN,
)

Case = dict[str, Any]


@dataclass(frozen=True, kw_only=True, slots=True)
class Figure:
    """One line of a scoreboard."""

    name: str
    value: str
    aim: str = ""


def of_kinds(cases: Iterable[Case], *kinds: str, medium: bool = False) -> list[Case]:
    """Return the cases of some kinds; `medium` leaves weak ones out."""
    return [
        c for c in cases
        if c["secret"]["kind"] in kinds and (not medium or c["secret"]["strength"] > 0)
    ]  # fmt: skip


def _mean(values: Iterable[float]) -> str:
    found = [v for v in values if np.isfinite(v)]
    return f"{np.mean(found):.2f} ({len(found)})" if found else "none (0)"


def share(hits: int, of: int) -> str:
    """Write a share with its exact interval."""
    if not of:
        return "none (0)"
    low, high = clopper_pearson(hits, of)
    return f"{hits} of {of}, 95 % interval {low:.3f} to {high:.3f}"


def figures(scored: dict[str, Any]) -> list[Figure]:
    """Return the lines of a judged set's scoreboard."""
    cases = list(scored["cases"].values())
    family = cases[0]["secret"].get("family", "first") if cases else "first"
    aims = scored.get("protocol", {}).get("aims", AIMS)[family]

    def of(*kinds: str, medium: bool = False) -> list[Case]:
        return of_kinds(cases, *kinds, medium=medium)

    def mean(group: list[Case], name: str) -> str:
        return _mean(float(c["score"][name]) for c in group)

    nulls = [c for c in of("null") if c["run"]["code"] == 0]
    strange, holding = of("unknown"), of("one", "two", "unknown", "decoy", "undecidable")
    hidden = [c for c in holding if c["facts"].get("concealed")]
    known, strong = of("one", "two"), of("one", "two", medium=True)
    seen = [c for c in of("one", medium=True) if c["facts"].get("oracle_z", 0.0) > ORACLE_SEES]
    weak = [c for c in of("one") if c["secret"]["strength"] == 0]
    rows = [
        (ALARMS, share(_count(nulls, lambda c: c["score"]["alarm"]), len(nulls))),
        *_alarms_by_file(nulls),
        ("- nulls with each", _given(nulls)),
        (TOP_1, mean(of("one", medium=True), "top_1")),
        ("- of these where the held-out mean tells the oracle", mean(seen, "top_1")),
        *_by_evidence(seen),
        ("top-1, weak", mean(weak, "top_1")),
        (PRECISION, mean(strong, "precision")),
        ("recall, medium and strong", mean(strong, "recall")),
        ("truth among the names offered", mean(known, "covered")),
        ("names offered a case", mean(known, "set_size")),
        ("undecidable: the whole set offered", mean(of("undecidable"), "covered")),
        *_further(of("undecidable")),
        ("decoys named rightly", mean(of("decoy"), "top_1")),
        (UNKNOWN, share(_count(strange, lambda c: c["score"]["flagged"]), len(strange))),
        *_probabilities(cases),
        (COVERAGE, share(*_coverage(cases))),
        (IOU, mean(of("one", "two", "decoy"), "iou")),
        ("- of the true region with that of four other draws",
         _mean(c["ceiling"] for c in of("one", "two", "decoy"))),
        (SHARE, mean(known, "recovered")),
        ("- half of the cases are below", _median(float(c["score"]["recovered"]) for c in known)),
        *_baselines(cases),
        (CONCEALED,
         f"{len(hidden)} of {len(holding)}, {_count(hidden, lambda c: c['score']['alarm'])}"),
        ("no answer (counted as misses, not as alarms)",
         str(_count(cases, lambda c: c["run"]["code"] != 0))),
        ("seconds a case, median and longest", _seconds(cases)),
    ]  # fmt: skip
    return [Figure(name=name, value=value, aim=aims.get(name, "")) for name, value in rows]


def _count(group: Sequence[Case], test: Callable[[Case], Any]) -> int:
    return sum(bool(test(c)) for c in group)


def _median(values: Iterable[float]) -> str:
    found = [v for v in values if np.isfinite(v)]
    return f"{np.median(found):.2f} ({len(found)})" if found else "none (0)"


def _seconds(cases: Sequence[Case]) -> str:
    took = sorted(float(c["run"]["seconds"]) for c in cases)
    return f"{took[len(took) // 2]:.0f}, {took[-1]:.0f}" if took else "none"


def _by_evidence(seen: Sequence[Case]) -> list[tuple[str, str]]:
    """Top-1 by how plainly the held-out recording tells perfect knowledge, and by baselines.

    What is missed there is not missed for want of evidence.
    """
    limit = 3 * ORACLE_SEES
    groups = {
        f"beyond {limit:.0f} sigma": [c for c in seen if c["facts"]["oracle_z"] > limit],
        f"up to {limit:.0f} sigma": [c for c in seen if c["facts"]["oracle_z"] <= limit],
        **_with_and_without(seen, "baselines", "baselines"),
    }
    rows = [
        (f"  - {text}", _mean(float(c["score"]["top_1"]) for c in group))
        for text, group in groups.items()
    ]
    nothing = _count(seen, lambda c: not c["score"]["reported"])
    return [*rows, ("  - no name at all", f"{nothing} of {len(seen)}")]


def _alarms_by_file(nulls: Sequence[Case]) -> list[tuple[str, str]]:
    """Alarms with and without baselines and reference plates, where a set has both."""
    rows = []
    for key, text in (("baselines", "baselines"), ("plates", "reference plates")):
        for which, group in _with_and_without(nulls, key, text).items():
            if 0 < len(group) < len(nulls):
                alarms = _count(group, lambda c: c["score"]["alarm"])
                rows.append((f"- {which}", f"{alarms} of {len(group)}"))
    return rows


def _with_and_without(cases: Sequence[Case], key: str, text: str) -> dict[str, list[Case]]:
    """Part cases by whether they come with some of what a key of their secret counts."""
    return {
        f"with {text}": [c for c in cases if c["secret"].get(key, 0) > 0],
        f"without {text}": [c for c in cases if c["secret"].get(key, 0) == 0],
    }


def _given(nulls: Sequence[Case]) -> str:
    """Count the nulls in which each effect, or each thing without a name, was reported."""
    count = Counter(
        what for c in nulls for what in {*c["score"]["reported"], *c["score"]["left"]}
    )
    return ", ".join(f"{what} {n}" for what, n in count.most_common()) or "none"


def _further(undecidable: Sequence[Case]) -> list[tuple[str, str]]:
    """Say what a second scan decides; a case without a proposed scan counts as undecided."""
    if not any(c["further"][way] is not None for c in undecidable for way in (RANKED, RANDOM)):
        return []
    rows = []
    for way, text in ((RANKED, "the scan ranked first"), (RANDOM, "a random scan")):
        got = [c["further"][way] or {"right": False, "alone": False} for c in undecidable]
        right, alone = (sum(bool(g[key]) for g in got) for key in ("right", "alone"))
        rows += [
            (f"undecidable, after {text}: right name first", share(right, len(got))),
            (f"undecidable, after {text}: and no rival left", share(alone, len(got))),
        ]
    unasked = [c for c in undecidable if c["further"][RANKED] is None]
    right = _count(unasked, _true_name_first)
    rows.append(("  - no scan proposed: right name first", share(right, len(unasked))))
    return rows


def _true_name_first(case: Case) -> bool:
    """Whether the name reported first is what is hidden, not a rival that is as likely."""
    return bool(accepted(case["secret"]).intersection(case["score"]["reported"][:1]))


def _probabilities(cases: Sequence[Case]) -> list[tuple[str, str]]:
    named = [pair for c in cases for pair in stated(c)]
    rows = [(ERROR, "no probabilities")]
    if named:
        error = calibration_error(reliability(named))
        rows = [
            (ERROR, f"{error:.3f} ({len(named)})"),
            ("- expected of true probabilities, by chance", f"{error_by_chance(named):.3f}"),
            ("log score of probabilities, nats a name", f"{log_score(named):.2f} ({len(named)})"),
            ("- expected of true probabilities", f"{score_by_chance(named):.2f}"),
        ]
    strange = [pair for c in cases for pair in stated_strange(c)]
    if strange:
        rows.append(("log score of 'none of these', nats a case with something hidden",
                     f"{log_score(strange):.2f} ({len(strange)})"))  # fmt: skip
    return rows


def _coverage(cases: Sequence[Case]) -> tuple[int, int]:
    held = [h for c in cases for h in c["intervals"]]
    return sum(held), len(held)


def _baselines(cases: Sequence[Case]) -> list[tuple[str, str]]:
    """Return what simpler methods reach on the same cases."""
    known = of_kinds(cases, "one", "two")
    rows = [
        ("- baseline: smooth surface, no physics", _mean(c["free_form_recovered"] for c in known)),
        ("- baseline: pose refitted only", _mean(c["pose_recovered"] for c in known)),
        ("- baseline: noise refitted only (moves no mean)", "0.00"),
    ]
    mixed = [c for c in known if c["shuffled"]]
    if mixed:
        single = of_kinds(mixed, "one")
        rows += [
            ("- baseline: learnt from shuffled covariates",
             _mean(float(c["shuffled"]["recovered"]) for c in mixed)),
            ("shuffled covariates: top-1, one effect (chance is right)",
             _mean(float(c["shuffled"]["top_1"]) for c in single)),
            ("- the same cases as they are", _mean(float(c["score"]["top_1"]) for c in single)),
        ]  # fmt: skip
    boosted = [c for c in cases if c["boosted"]]
    if boosted:
        nulls = of_kinds(boosted, "null")
        rows += [
            ("gradient-boosted classifier: alarms on nulls",
             share(_count(nulls, lambda c: c["boosted"]["alarm"]), len(nulls))),
            ("gradient-boosted classifier: top-1, medium and strong, one effect",
             _mean(float(c["boosted"]["top_1"]) for c in of_kinds(boosted, "one", medium=True))),
            ("gradient-boosted classifier: recall, medium and strong",
             _mean(float(c["boosted"]["recall"])
                   for c in of_kinds(boosted, "one", "two", medium=True))),
            ("gradient-boosted classifier: calibration error",
             _boosted_error(boosted)),
        ]  # fmt: skip
    return rows


def _boosted_error(boosted: Sequence[Case]) -> str:
    named = [(float(p), bool(right)) for c in boosted for p, right in c["boosted"]["stated"]]
    return f"{calibration_error(reliability(named)):.3f} ({len(named)})" if named else "none (0)"


def table(boards: dict[str, list[Figure]]) -> list[str]:
    """Return one Markdown table of several sets' scoreboards, a column of values for each."""
    names = list(dict.fromkeys(f.name for board in boards.values() for f in board))
    found = {label: {f.name: f for f in board} for label, board in boards.items()}
    heads = [head for label in boards for head in (label, "aim")]
    lines = ["| figure | " + " | ".join(heads) + " |", "| --- |" + " --- |" * len(heads)]
    for name in names:
        cells = []
        for label in boards:
            figure = found[label].get(name, Figure(name=name, value=""))
            cells += [figure.value, figure.aim]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return lines


def curve(scored: dict[str, Any]) -> list[str]:
    """Return the reliability curve as a Markdown table; one line where nothing was stated."""
    named = [pair for c in scored["cases"].values() for pair in stated(c)]
    if not named:
        return ["The answers state no probabilities."]
    lines = ["| probability stated, mean | share right | names |", "| --- | --- | --- |"]
    return lines + [f"| {p:.2f} | {right:.2f} | {n} |" for p, right, n in reliability(named)]
