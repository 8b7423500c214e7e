"""The page of the sealed proof: one page for a sceptic, then protocol, tables and the record."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from challenge.cases.case import Secret, stage
from challenge.cases.seeds import child, number
from challenge.judging.probabilities import stated
from challenge.judging.score import clopper_pearson
from challenge.proof.choice import pick_stories
from challenge.proof.pictures import draw_instrument, draw_power
from challenge.proof.scoreboard import curve, figures, of_kinds, table
from challenge.proof.story import Story, tell
from challenge.proof.story_picture import draw_story
from challenge.sets.aims import ALARMS, IOU, PRECISION, SHARE, TOP_1, UNKNOWN
from challenge.sets.populations import needs_aggregate

STRENGTHS = ("weak", "medium", "strong")
SURE = 0.9
"""A name with at least this probability is one to act on."""
_HEAD = "## Record of sealed runs"
Scored = dict[str, Any]


@dataclass(frozen=True, kw_only=True, slots=True)
class Judged:
    """A judged set and its folder.

    Attributes
    ----------
    label : of the family, as columns are headed
    open : whether its cases may be shown
    """

    scored: Scored
    folder: Path
    label: str
    open: bool

    @classmethod
    def of(cls, scored: Scored, folder: Path) -> "Judged":
        """Label a judged set by its family and its population."""
        label = f"{scored['family']} family ({scored['population']})"
        return cls(scored=scored, folder=folder, label=label,
                   open=not needs_aggregate(scored["population"]))  # fmt: skip

    @property
    def cases(self) -> list[dict[str, Any]]:
        """Judged cases."""
        return list(self.scored["cases"].values())


def summary(sets: Sequence[Judged]) -> list[str]:
    """Return what a sceptic asks first, a column for each set."""
    rows: list[tuple[str, Callable[[list[dict[str, Any]]], str]]] = [
        ("Instruments in good order that were declared faulty",
         lambda c: _part(of_kinds(c, "null"), lambda x: x["score"]["alarm"])),
        ("Single faults, medium and strong: named rightly, first",
         lambda c: _part(of_kinds(c, "one", medium=True), lambda x: x["score"]["top_1"] == 1)),
        ("- of those that the paper's own checks miss",
         lambda c: _part([x for x in of_kinds(c, "one", medium=True)
                          if x["facts"].get("concealed")], lambda x: x["score"]["top_1"] == 1)),
        ("Faults that no name in the catalogue fits: admitted as such",
         lambda c: _part(of_kinds(c, "unknown"), lambda x: x["score"]["flagged"])),
        (f"Names given a probability of {SURE} or more: right", _sure),
        ("Share of the misfit that perfect knowledge removes, removed",
         lambda c: _mean([x["score"]["recovered"] for x in of_kinds(c, "one", "two")])),
        ("Cases that one scan can't decide: right after the scan proposed first",
         lambda c: _part(of_kinds(c, "undecidable"),
                         lambda x: (x["further"]["ranked"] or {}).get("right", False))),
    ]  # fmt: skip
    asked = "asked (in brackets: 95 % interval of the share)"
    lines = ["| " + " | ".join([asked, *(s.label for s in sets)]) + " |",
             "| --- |" + " --- |" * len(sets)]  # fmt: skip
    for text, figure in rows:
        lines.append(f"| {text} | " + " | ".join(figure(s.cases) for s in sets) + " |")
    return lines


def _part(group: Sequence[dict[str, Any]], test: Callable[[dict[str, Any]], bool]) -> str:
    hits = sum(bool(test(c)) for c in group)
    if not group:
        return "none"
    low, high = clopper_pearson(hits, len(group))
    return f"{hits} of {len(group)} ({low:.2f} to {high:.2f})"


def _sure(cases: Sequence[dict[str, Any]]) -> str:
    given = [right for c in cases for p, right in stated(c) if p >= SURE]
    if not given:
        return "none stated"
    low, high = clopper_pearson(sum(given), len(given))
    return f"{sum(given)} of {len(given)} ({low:.2f} to {high:.2f})"


def _mean(values: Sequence[float]) -> str:
    found = [v for v in values if np.isfinite(v)]
    return f"{np.mean(found):.2f} of 1 ({len(found)} cases)" if found else "none"


def _nulls(scored: Scored) -> list[str]:
    """Return what the keys of nulls say about their distance from the maker's file."""
    kept = [c["facts"] for c in scored["cases"].values() if c["secret"]["kind"] == "null"]
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
    return lines if len(lines) > 2 else ["None in this set."]


def _confusion(judged: Judged) -> list[str]:
    """Rows: what was hidden, by its kind alone in a test set. Reported names, frequent first."""
    rows: dict[str, list[dict[str, Any]]] = {}
    for case in judged.cases:
        secret = case["secret"]
        label = str(secret["kind"])
        if judged.open:
            label += ": " + (" + ".join(secret["switches"]) or "nothing")
        rows.setdefault(label, []).append(case)
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


def _stories(judged: Judged, pictures: Path) -> list[dict[str, str]]:
    """Tell the stories of an opened set of the first family; pictures of another run are removed.

    A case without an answer has none.
    """
    for old in pictures.glob("proof-story-*.png"):
        old.unlink()
    out: list[dict[str, str]] = []
    for title, name in pick_stories(judged.scored):
        case = judged.scored["cases"][name]
        story = tell(judged.folder, name, case, stage(Secret.of_key(case["secret"])))
        if story is None:
            continue
        picture = f"proof-story-{len(out) + 1}.png"
        draw_story(story, pictures / picture)
        out.append({"title": title, "alt": title, "picture": picture,
                    "text": _told(case, story)})  # fmt: skip
    return out


def _told(case: dict[str, Any], story: Story) -> str:
    """Write what was hidden and what was answered."""
    secret, score = case["secret"], case["score"]
    hidden = " and ".join(secret["switches"]) or "nothing"
    names = ", ".join(score["reported"]) or "nothing"
    beside = [n for n in score["offered"] if n not in score["reported"]]
    size = f" ({STRENGTHS[secret['strength']]})" if secret["switches"] else ""
    also = f"; as alternatives: {', '.join(beside)}" if beside else ""
    text = (
        f"Hidden: {hidden}{size}, on a part of the kind '{secret['shape']}'. "
        f"Verdict: **{case['verdict']}**; reported: {names}{also}."
    )
    said = [str(e["statement"]) for e in case["effects"] if e.get("statement")]
    said += [
        f"Unexplained: {r['channel']} over {r['covariate']}, probability {r['probability']:.2f}."
        for r in story.answer.get("left", ())
    ]
    quoted = "\n>\n".join(f"> {line}" for line in said)
    return f"{text}\n\n{quoted}" if said else text


def write_page(sets: Sequence[Judged], page: Path, *, commit: str) -> None:
    """Write the page and its pictures; earlier runs' records on it are kept.

    Parameters
    ----------
    sets
        Judged sets, one of each family at most.
    page
        Markdown file; pictures go into ``pictures/`` beside it.
    commit
        Of the code that was judged.
    """
    pictures = page.parent / "pictures"
    pictures.mkdir(parents=True, exist_ok=True)
    shown = next((s for s in sets if s.open), None)
    stories: list[dict[str, str]] = []
    if shown is not None:
        draw_power(shown.scored, pictures / "proof-power.png")
        if shown.scored["family"] == "first":
            stories = _stories(shown, pictures)
            _show_instrument(shown.scored, pictures / "proof-instrument.png")
    first = next((s for s in sets if s.scored["family"] == "first"), None)
    protocol = sets[0].scored["protocol"]
    environment = Environment(
        loader=PackageLoader("challenge", "proof"), undefined=StrictUndefined,
        keep_trailing_newline=True, trim_blocks=False,
    )  # fmt: skip
    text = environment.get_template("proof.md.j2").render(
        when=f"commit {commit}",
        cases=" and ".join(f"{s.scored['sealed']} cases of the {s.label}" for s in sets),
        summary=summary(sets), stories=stories,
        protocol=[f"- {k.replace('_', ' ')}: {v}" for k, v in protocol.items()
                  if k != "aims"],
        stopped=[line for s in sets for line in stopped(s)],
        board=table({s.label: figures(s.scored) for s in sets}), power=shown is not None,
        curves=[(s.label.capitalize(), curve(s.scored)) for s in sets],
        nulls=["None judged."] if first is None else _nulls(first.scored),
        confusion=[(s.label.capitalize(), _confusion(s)) for s in sets],
        record=record(sets, page, commit),
    )  # fmt: skip
    page.write_text(text.rstrip() + "\n", encoding="utf-8")


def stopped(judged: Judged) -> list[str]:
    """Say so where the clock ended the run before the set was through."""
    done, sealed = len(judged.cases), judged.scored["sealed"]
    if done == sealed:
        return []
    return [
        f"The clock stopped the run of the {judged.label}: {done} of {sealed} sealed cases were "
        "diagnosed, in the random order in which they were sealed; no key was opened before."
    ]


def _show_instrument(scored: Scored, file: Path) -> None:
    """Scan the first case once more and keep a frame from its middle."""
    kept = next(iter(scored["cases"].values()))["secret"]
    secret = Secret.of_key(kept)
    world = stage(secret).on
    device, path = world.device, world.scans.paths[0]
    assert device.calibration is not None
    row, brightness, frame = device.rows_of(
        world.solid, world.surface, path, child(secret.seed, "picture"),
        specimen=number(secret.seed, "specimen"), misplaced=world.scans.misplaced[0],
        keep=path.profiles // 2,
    )  # fmt: skip
    draw_instrument(frame, device.calibration.depth_mm(row), brightness, file)


def record(sets: Sequence[Judged], page: Path, commit: str) -> list[str]:
    """One line for every run judged so far, these last.

    A test set's master seed would open it, so its line names the commit.
    """
    before: list[str] = []
    if page.exists():
        text = page.read_text(encoding="utf-8").split(_HEAD)
        before = [line for line in text[-1].splitlines() if line.startswith("- ")]
    for judged in sets:
        values = {f.name: f.value for f in figures(judged.scored)}
        count, sealed = len(judged.cases), judged.scored["sealed"]
        of = f"{count} cases"
        if count < sealed:
            of = f"{count} of {sealed} cases, stopped by the clock"
        which = f"seed {judged.scored['seed']}" if judged.open else f"test set, commit {commit}"
        now = f"- {which} ({of}): alarms " + "; ".join(
            [values[ALARMS], f"top-1 {values[TOP_1]}", f"precision {values[PRECISION]}",
             f"unknowns {values[UNKNOWN]}", f"IoU {values[IOU]}",
             f"share, at most 1, {values[SHARE]}"]
        )  # fmt: skip
        before = [*[line for line in before if not line.startswith(f"- {which} ")], now]
    return before
