"""The page of the sealed proof: scoreboard, confusion, power, stories, doubts."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from challenge.cases.case import RECORDINGS, Secret, stage
from challenge.cases.seeds import child, number
from challenge.probabilities import calibration_error, log_score, reliability, stated
from challenge.proof_pictures import draw_instrument, draw_power, draw_story
from challenge.score import clopper_pearson

_STRENGTHS = ("weak", "medium", "strong")
ORACLE_SEES = 8.0  # standard deviations
_INSTRUMENT = """\
## The instrument

A Gaussian laser sheet meets the mesh in sub-lines a fraction of its width apart; every scatterer
sends light with its own phase, fixed to the part; lens, shutter, chip and peak finder make rows
of it, and the instrument's own calibration, learnt from a noisy target, makes depth of rows.
Nothing adds a depth. Checked against theory by `tests/challenge`: the speckle limit
σz = λ/(2π sin u sin θ) at full contrast and its growth with line width and shrinking aperture,
0.80 s cot θ at a half-covered line, e^(-2π²σ²)/π of pixel locking, h tan θ of a shadow,
κ s √(2/π) (1-r)/(1+r) cot θ at a printed edge, no bias on a tilted plane.

![One frame, and what is delivered](pictures/proof-instrument.png)

Readings of neighbouring profiles are correlated negatively, and the brightness slope along the
travel is correlated with the error: both come from speckle, nulls and reference plates have them
too.
"""
_DOUBTS = """\
## What a sceptic should still doubt

- The instrument and the diagnosis share no code, but they share a project: both were built from
  the same page of physics. What that page leaves out, both leave out.
- The instrument is one family of designs (point-by-column camera, Gaussian sheet, fan of evenly
  spaced angles). Its lens distorts along the rows only, its Scheimpflug focus is perfect, its
  scattering cells are independent (no micro-facets that shade each other).
- A null is verified on two strips of each recording. At edges the maker's file describes the
  line with a simpler model than the instrument obeys; the tolerance is the table's above, so a
  diagnosis that takes every edge at its word would be right to complain.
- Noise is speckle on one kind of matt finish. Its dependence on slope is given to the diagnosis
  as the maker's two numbers, which are fits.
- Cases of pixel locking have a camera with fewer rows, which their file states, as it must.
- The part lies within 0.03 mm and 0.02 degrees of where the poses say. Worse placing was not tried.
- The share of the oracle's gain uses clipped RMS in the held-out recording, so it speaks of the
  mean only; effects on noise or on missing points have none.
- Before the third run (protocol 3) the oracle of a long exposure was moved to where a registration
  finds the part; the runs before counted a shift that no answer can gain. Nothing else of making or
  judging changed up to the thirteenth run.
- A true region comes of four draws and holds their speckle; four others of the same case give
  another. Their overlap stands in the table where it was measured (`flawforge challenge regions`,
  after the keys were opened).
- Up to protocol 3 a true region had shifts removed that flats alone can't tell: up to 1.4 points
  that no effect had made, a frame about each edge of a terrace. The fault was found on opened cases
  of the twelfth run and mended while the thirteenth ran, before its keys were opened. The
  thirteenth's regions were drawn again from the keys, with the same speckle (0.47 in the record;
  0.45 with those as sealed). Later sets were sealed so. The runs before stand as they were judged.
- Small jobs ran beside the first ten minutes of the sixteenth run, which commit 1a82492 diagnosed.
  What its opened cases taught was in the code of the seventeenth (03416ad, nothing beside it).
- Sets of 160 cases differ: of the last three runs the seventeenth met every aim, the sixteenth
  missed two by 0.03 and the fifteenth one by 0.1. The seventeenth's share of the gain, counted to
  1 in each case, is below 0.7; another set may miss it.
- Up to the seventeenth run `simulated` was the better of two placements and `explained` the best
  of four, chosen by all readings of the recording. Both now come of the same candidates, and the
  judge's expectation is the map's. The seventeenth run's answers weren't kept: its figures stand as
  they were judged and await a run of their own. Of the opened calibration population two cases were
  diagnosed before and after: the logarithm of the gain went from 0.100 to 0.106 (`line_bow`) and
  from 0.267 to 0.272 (`motion_blur`); a null had an RMS of 40.7 µm before and 37.2 µm after with no
  effect found, and has 37.6 µm in both.
- Light from facing walls is followed along 32 rays from each place, the same in every frame. Their
  pattern is in the oracle, too: on grooves part of its gain belongs to it, and no law has that.
- Up to protocol 4 pairs with pixel locking had a region and an oracle, although the instrument
  without the effects has the same coarse camera and its locking: a diagnosis that found it lost
  overlap and could gain more than the oracle. The fault was found on the sixteenth run's opened
  cases; without such pairs that run has an overlap of 0.49 (41) and a share of 0.72 (25). Later
  sets are judged so.
- The free-form baseline is a polynomial surface over the sensor's frame. Shuffling permutes
  blocks of 16 x 16 points, so what is smaller than a block keeps its shape. The seventeenth run has
  it for five cases, two of them with a share: 0.22, and 1.28 of a gain of 0.02.
- `camera_occlusion`, `edge_mixing`, `incidence_noise` and `incidence_bias` have no class of their
  own. An instrument of this kind always has the first three, a file without them would be untrue
  rather than something missing; no switch of the instrument was found that makes a bias with slope
  alone: a displaced sheet is a displaced part, and translucence counts as either name.
"""


def _mean(values: Iterable[float]) -> tuple[float, int]:
    found = [v for v in values if np.isfinite(v)]
    return (float(np.mean(found)) if found else float("nan")), len(found)


def _figure(value: float, count: int, aim: str) -> str:
    return f"{value:.2f} ({count}) | {aim}" if count else f"none (0) | {aim}"


def scoreboard(scored: dict[str, Any]) -> list[str]:
    """Return the scoreboard as lines of a Markdown table."""
    cases = scored["cases"].values()

    def of(*kinds: str, medium: bool = False) -> list[dict[str, Any]]:
        return [
            c
            for c in cases
            if c["secret"]["kind"] in kinds and (not medium or c["secret"]["strength"] > 0)
        ]

    def mean(group: list[dict[str, Any]], name: str) -> tuple[float, int]:
        return _mean(float(c["score"][name]) for c in group)

    nulls = [c for c in of("null") if c["run"]["code"] == 0]
    alarms = sum(bool(c["score"]["alarm"]) for c in nulls)
    low, high = clopper_pearson(alarms, len(nulls)) if nulls else (0.0, 1.0)
    strange = of("unknown")
    flagged = sum(bool(c["score"]["flagged"]) for c in strange)
    holding = of("one", "two", "unknown", "decoy", "undecidable")
    hidden = [c for c in holding if c["facts"].get("concealed")]
    found = sum(bool(c["score"]["alarm"]) for c in hidden)
    failed = sum(c["run"]["code"] != 0 for c in cases)
    seconds = sorted(float(c["run"]["seconds"]) for c in cases)
    free = _mean(float(c["free_form_recovered"]) for c in of("one", "two"))
    posed = _mean(float(c["pose_recovered"]) for c in of("one", "two"))
    shares = np.array([float(c["score"]["recovered"]) for c in of("one", "two")])
    counted = shares[np.isfinite(shares)]
    mixed = [c for c in of("one", "two") if c["shuffled"]]
    seen = [c for c in of("one", medium=True) if c["facts"].get("oracle_z", 0.0) > ORACLE_SEES]
    lines = [
        "| figure | value (cases) | aim |",
        "| --- | --- | --- |",
        f"| alarms on nulls | {alarms} of {len(nulls)}, 95 % interval {low:.3f} to {high:.3f} "
        "| at most 1 of 60 |",
    ]
    rows: list[tuple[str, tuple[float, int], str]] = [
        ("top-1, medium and strong, one effect", mean(of("one", medium=True), "top_1"), ">= 0.8"),
        ("- of these where the held-out mean tells the oracle", mean(seen, "top_1"), ""),
        ("top-1, weak", mean([c for c in of("one") if c["secret"]["strength"] == 0], "top_1"), ""),
        ("precision, medium and strong", mean(of("one", "two", medium=True), "precision"),
         ">= 0.9"),
        ("recall, medium and strong", mean(of("one", "two", medium=True), "recall"), ""),
        ("truth among what was offered", mean(of("one", "two"), "covered"), ""),
        ("names offered a case", mean(of("one", "two"), "set_size"), ""),
        ("undecidable: the whole set offered", mean(of("undecidable"), "covered"), ""),
        ("decoys named rightly", mean(of("decoy"), "top_1"), ""),
        ("overlap (IoU) of regions", mean(of("one", "two", "decoy"), "iou"), ">= 0.5"),
        ("- of the true region with that of four other draws",
         _mean(c["ceiling"] for c in of("one", "two", "decoy")), ""),
        ("- with the regions as they were sealed",
         _mean(c["sealed_iou"] for c in of("one", "two", "decoy")), ""),
        ("share of the oracle's gain", mean(of("one", "two"), "recovered"), ">= 0.7"),
        ("- no case counted above 1", _mean(np.minimum(counted, 1.0)), ""),
        ("- half of the cases are below",
         (float(np.median(counted)) if counted.size else float("nan"), counted.size), ""),
        ("- baseline: smooth surface, no physics", free, ""),
        ("- baseline: pose refitted only", posed, ""),
        ("- baseline: noise refitted only (moves no mean)", (0.0, free[1]), ""),
        ("- baseline: learnt from shuffled covariates",
         _mean(float(c["shuffled"]["recovered"]) for c in mixed), ""),
        ("shuffled covariates: top-1, one effect",
         _mean(float(c["shuffled"]["top_1"]) for c in mixed if c["secret"]["kind"] == "one"),
         "chance"),
        ("- the same cases as they are",
         _mean(float(c["score"]["top_1"]) for c in mixed if c["secret"]["kind"] == "one"), ""),
    ]  # fmt: skip
    lines += [f"| {name} | {_figure(*value, aim)} |" for name, value, aim in rows]
    named = [pair for c in cases for pair in stated(c)]
    if named:
        error, score = calibration_error(reliability(named)), log_score(named)
        lines += [
            f"| expected calibration error of probabilities | {error:.3f} ({len(named)}) "
            "| <= 0.07 |",
            f"| log score of probabilities, nats a name | {score:.2f} ({len(named)}) | |",
        ]
    lines += [
        f"| unknowns flagged | {flagged} of {len(strange)} | >= 0.8 |",
        f"| concealed from the usual checks | {len(hidden)} of {len(holding)}, "
        f"of these detected {found} | at least half concealed |",
        f"| no answer (counted as misses, not as alarms) | {failed} | 0 |",
        f"| seconds a case, median and longest | {seconds[len(seconds) // 2]:.0f}, "
        f"{seconds[-1]:.0f} | |",
    ]
    return lines


def _nulls(scored: dict[str, Any]) -> list[str]:
    """Return what the keys of nulls say about their distance from the maker's file."""
    kept = [c["facts"] for c in scored["cases"].values() if c["secret"]["kind"] == "null"]
    if not kept:
        return ["None in this set."]
    lines = ["| over 100 speckle draws | median null | worst null |", "| --- | --- | --- |"]
    for name, text in (
        ("departure", "off edges: largest block mean, sigma"),
        ("lost", "off edges: share of points that return against the file"),
        ("edge_departure", "at edges: mean departure of a point, sigma (each at most 10)"),
        ("edge_lost", "at edges: share of points that return against the file"),
    ):
        values = [float(facts[name]) for facts in kept if name in facts]
        if values:
            lines.append(f"| {text} | {np.median(values):.3f} | {max(values):.3f} |")
    return lines


def _confusion(scored: dict[str, Any]) -> list[str]:
    """Rows: what was hidden. What was reported, most frequent first."""
    rows: dict[str, list[dict[str, Any]]] = {}
    for case in scored["cases"].values():
        secret = case["secret"]
        label = " + ".join(secret["switches"]) or "nothing"
        rows.setdefault(f"{secret['kind']}: {label}", []).append(case)
    lines = ["| hidden | cases | verdicts | reported |", "| --- | --- | --- | --- |"]
    for label in sorted(rows):
        verdicts: dict[str, int] = {}
        names: dict[str, int] = {}
        for case in rows[label]:
            verdicts[case["verdict"]] = verdicts.get(case["verdict"], 0) + 1
            for name in case["score"]["reported"] or ["-"]:
                names[name] = names.get(name, 0) + 1
        lines.append(
            f"| {label} | {len(rows[label])} | {_counted(verdicts)} | {_counted(names)} |"
        )
    return lines


def _counted(found: dict[str, int]) -> str:
    ordered = sorted(found.items(), key=lambda item: -item[1])
    return ", ".join(f"{name} {count}" for name, count in ordered)


def _pick_stories(scored: dict[str, Any]) -> list[tuple[str, str]]:
    """Choose five cases: two good ones, the worst alarm, the worst miss, an unknown."""
    cases = scored["cases"]

    def first(test: Callable[[dict[str, Any]], bool], key: Callable[[dict[str, Any]], float],
              taken: list[str]) -> str | None:  # fmt: skip
        fit = [n for n, c in cases.items() if test(c) and n not in taken]
        return max(fit, key=lambda n: key(cases[n])) if fit else None

    def gain(case: dict[str, Any]) -> float:
        return float(case["facts"].get("oracle_gain", 0.0))

    wanted: list[tuple[str, Callable[[dict[str, Any]], bool]]] = [
        ("Named rightly", lambda c: c["secret"]["kind"] == "one" and c["score"]["top_1"] == 1),
        (
            "Concealed from the usual checks, and named",
            lambda c: bool(c["facts"].get("concealed")) and c["score"]["top_1"] == 1,
        ),
        ("A false alarm", lambda c: c["secret"]["kind"] == "null" and c["score"]["alarm"]),
        (
            "The worst miss",
            lambda c: c["secret"]["kind"] in ("one", "two") and c["score"]["recall"] == 0,
        ),
        ("Outside the catalogue", lambda c: c["secret"]["kind"] == "unknown"),
    ]
    told: list[tuple[str, str]] = []
    for title, test in wanted:
        name = first(test, gain, [n for _, n in told])
        if name is not None:
            told.append((title, name))
    return told


def _story(title: str, name: str, case: dict[str, Any]) -> list[str]:
    secret, score = case["secret"], case["score"]
    hidden = " and ".join(secret["switches"]) or "nothing"
    lines = [
        f"### {title}: {name}",
        "",
        f"Hidden: {hidden} ({_STRENGTHS[secret['strength']]}), on a part of the kind "
        f"'{secret['shape']}'. Answer: **{case['verdict']}**; reported "
        f"{', '.join(score['reported']) or 'nothing'}"
        + (f"; offered beside it {', '.join(score['offered'])}." if score["offered"] else "."),
        "",
    ]
    lines += [f"> {e['statement']}" for e in case["effects"][:3] if e.get("statement")]
    return [*lines, "", f"![{name}](pictures/proof-{name}.png)", ""]


def write_page(scored: dict[str, Any], out: Path, page: Path) -> None:
    """Write the page and its pictures; earlier runs' records on it are kept.

    Parameters
    ----------
    scored
        From the judge.
    out
        Folder of the set.
    page
        Markdown file; pictures go into ``pictures/`` beside it.
    """
    pictures = page.parent / "pictures"
    pictures.mkdir(parents=True, exist_ok=True)
    draw_power(scored, pictures / "proof-power.png")
    _show_instrument(scored, pictures / "proof-instrument.png")
    board = scoreboard(scored)
    aims = [f"- {k.replace('_', ' ')}: {v}" for k, v in scored["protocol"].items()]
    lines = [
        "# The sealed proof",
        "",
        "Written by `make proof`. A virtual profilometer at image level (`challenge/`) makes "
        "recordings with something missing from the maker's word; the diagnosis gets what a "
        "stranger gets; keys were committed by SHA-256(nonce ‖ key) before the first diagnosis "
        f"and opened after the last. Master seed, from the operating system: {scored['seed']}.",
        "",
        "## Protocol, frozen before the run",
        "",
        *aims,
        "",
        _INSTRUMENT,
        "## Nulls, as verified before they were sealed",
        "",
        *_nulls(scored),
        "",
        "## Scoreboard",
        "",
        *_stopped(scored),
        *board,
        "",
        "![Detection against strength](pictures/proof-power.png)",
        "",
        "## What was hidden, what was said",
        "",
        *_confusion(scored),
        "",
        "## Cases as stories",
        "",
    ]
    for title, name in _pick_stories(scored):
        case = scored["cases"][name]
        last = RECORDINGS[case["secret"]["recordings"] - 1]
        draw_story(out, name, last, pictures / f"proof-{name}.png")
        lines += _story(title, name, case)
    lines += [_DOUBTS, "## Record of sealed runs", ""]
    lines += _record(scored, board, page)
    page.write_text("\n".join(lines) + "\n")


def _stopped(scored: dict[str, Any]) -> list[str]:
    """Say so where the clock ended the run before the set was through."""
    judged, sealed = len(scored["cases"]), scored.get("sealed", len(scored["cases"]))
    if judged == sealed:
        return []
    return [
        f"The clock stopped the run: {judged} of {sealed} sealed cases were diagnosed, in the "
        "random order in which they were sealed; no key was opened before.",
        "",
    ]


def _show_instrument(scored: dict[str, Any], file: Path) -> None:
    """Scan the first case once more and keep a frame from its middle."""
    kept = next(iter(scored["cases"].values()))["secret"]
    secret = Secret.of_key(kept)
    world = stage(secret).on
    device, path = world.device, world.scans.paths[0]
    assert device.calibration is not None
    row, brightness, frame = device.rows_of(
        world.solid, world.finish, path, child(secret.seed, "picture"),
        specimen=number(secret.seed, "specimen"), misplaced=world.scans.misplaced[0],
        keep=path.profiles // 2,
    )  # fmt: skip
    draw_instrument(frame, device.calibration.depth_mm(row), brightness, file)


def _record(scored: dict[str, Any], board: list[str], page: Path) -> list[str]:
    """One line for every run judged so far, this one last."""
    before: list[str] = []
    if page.exists():
        text = page.read_text().split("## Record of sealed runs")
        before = [line for line in text[-1].splitlines() if line.startswith("- seed ")]
    values = {row.split("|")[1].strip(): row.split("|")[2].strip() for row in board[2:]}
    count, sealed = len(scored["cases"]), scored.get("sealed", len(scored["cases"]))
    of = f"{count} cases" if count == sealed else f"{count} of {sealed} cases, stopped by the clock"
    now = f"- seed {scored['seed']} ({of}): alarms " + "; ".join(
        [
            values["alarms on nulls"],
            f"top-1 {values['top-1, medium and strong, one effect']}",
            f"precision {values['precision, medium and strong']}",
            f"unknowns {values['unknowns flagged']}",
            f"IoU {values['overlap (IoU) of regions']}",
            "oracle share " + values["share of the oracle's gain"],
        ]
    )
    same = f"- seed {scored['seed']} "
    return [*[line for line in before if not line.startswith(same)], now]
