"""The page of the payoff: three sets of training data, one test, what is gained."""

from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from challenge.payoff import convolutional
from challenge.payoff.family import CONTROL
from challenge.payoff.flaws import RANGES
from challenge.payoff.gap import KINDS, TRAINED_ON, Outcome
from challenge.payoff.pictures import draw_examples, draw_precision
from challenge.payoff.precision import GROUPS, Estimate
from challenge.payoff.segmenter import FLAW_POINTS, PLAIN_POINTS, SETTINGS
from challenge.payoff.specimens import APART_MM, LABEL_MM
from challenge.payoff.trial import FAMILIES

AIM = 0.8
"""Share of the gap that diagnosed simulation with the plates' noise should close."""
WORDS = {
    "plain": "plain",
    "noise": "plates' noise",
    "diagnosed": "diagnosed",
    "both": "diagnosed, plates' noise",
    "instrument": "instrument",
}
ALARMS = ("explained", "partly_explained", "unexplained")
"""Verdicts that find a deviation."""


def _figure(value: Estimate | None, digits: int = 3) -> str:
    if value is None:
        return "gap not sure"
    return f"{value.value:.{digits}f} ({value.low:.{digits}f} to {value.high:.{digits}f})"


def _range(name: tuple[str, str]) -> str:
    length, width, depth = RANGES[name]
    across = "" if length == width else f" × {width[0]:g}-{width[1]:g}"
    return f"{length[0]:g}-{length[1]:g}{across} mm, {1e3 * depth[0]:g}-{1e3 * depth[1]:g} µm deep"


def headline(found: dict[str, Any]) -> list[str]:
    """Return the tables of worlds: each segmenter, for points and for flaws."""
    lines: list[str] = []
    sets = " | ".join(WORDS[name] for name in TRAINED_ON)
    for (kind, what), outcomes in found["outcomes"].items():
        lines += [
            f"| {kind}, {what}: world | {sets} | gap | share of it closed |",
            "| --- " * (len(TRAINED_ON) + 3) + "|",
        ]
        for name, result in outcomes.items():
            label = "**mean without the control**" if name == "all" else name
            means = " | ".join(_figure(m, 2) for m in result.mean())
            lines.append(
                f"| {label} | {means} | {_figure(result.gap())} | {_figure(result.closed(), 2)} |"
            )
        lines.append("")
    return lines


def _percent(value: Estimate | None) -> str:
    if value is None:
        return "an unknown share"
    return f"{value.value:.0%} ({value.low:.0%} to {value.high:.0%})"


def conclusions(found: dict[str, Any]) -> list[str]:
    """Say whether the aims are met: the gap with each segmenter, the noise's share, the control."""
    lines = []
    for kind in KINDS:
        outcomes = found["outcomes"][kind, "points"]
        result: Outcome | None = outcomes.get("all")
        if result is None:
            continue
        closed = result.closed()
        if closed is None:
            lines.append(
                f"{kind}: the mean gap between nominal simulation and instrument isn't significant."
            )
            continue
        word = "met" if closed.value >= AIM else "missed"
        if word == "met" and closed.low < AIM:
            word = "met, though the interval reaches below"
        alone, noise = result.closed("diagnosed"), result.closed("noise")
        lines.append(
            f"{kind}: over the worlds without the control, diagnosed simulation with the plates' "
            f"noise closes {_percent(closed)} of the gap in average precision of points. The aim, "
            f"at least {AIM:.0%}, is {word}. The diagnosis alone closes {_percent(alone)}, the "
            f"plates' noise alone {_percent(noise)}."
        )
    lines += _of_control(found)
    return lines


def _of_control(found: dict[str, Any]) -> list[str]:
    """Say whether the control alarms, and how much of its gap is the noise."""
    if CONTROL not in found["answers"]:
        return []
    answer = found["answers"][CONTROL]
    if answer["verdict"] in ALARMS:
        named = f" ({', '.join(answer['effects'])})" if answer["effects"] else ""
        lines = [f"The control alarms: {answer['verdict']}{named}."]
    else:
        lines = [f"The control does not alarm: {answer['verdict']}."]
    for kind in KINDS:
        result: Outcome = found["outcomes"][kind, "points"][CONTROL]
        gap, noise = result.gap(), result.closed("noise")
        if noise is None:
            lines.append(f"{kind}: the control's gap, {_figure(gap)}, is not significant.")
        else:
            lines.append(
                f"{kind}: the control, which lacks no effect, has a gap of {_figure(gap)}. The "
                f"plates' noise closes {_percent(noise)} of it."
            )
    return lines


def begin(family: str) -> str:
    """Return the line before a family's section; the next run replaces what is behind it."""
    return f"<!-- {family} family: begin -->"


def end(family: str) -> str:
    """Return the line after a family's section."""
    return f"<!-- {family} family: end -->"


def sections_of(page: Path) -> dict[str, str]:
    """Read the sections of a page that was written before; a line where there is none."""
    text = page.read_text(encoding="utf-8") if page.exists() else ""
    found = {}
    for family in FAMILIES:
        _, first, behind = text.partition(begin(family))
        held, last, _ = behind.partition(end(family))
        found[family] = held.strip() if first and last else "Not run yet."
    return found


def _pages() -> Environment:
    pages = Environment(
        loader=PackageLoader("challenge", "payoff"), undefined=StrictUndefined,
        keep_trailing_newline=True, autoescape=False,
    )  # fmt: skip
    pages.filters |= {"figure": _figure, "sizes": _range}
    return pages


def section(found: dict[str, Any], out: Path, pictures: Path) -> str:
    """Return a family's section, and draw its pictures."""
    plan = found["plan"]
    family = plan["family"]
    kept = {name: out / name / "tallies.npz" for name in plan["worlds"]}
    points = {kind: found["outcomes"][kind, "points"] for kind in KINDS}
    draw_precision(points, WORDS, pictures / f"payoff-{family}-precision.png")
    draw_examples(kept, WORDS, pictures / f"payoff-{family}-examples.png")
    seen: dict[tuple[str, str], int] = {}
    for name, file in kept.items():
        if name != CONTROL or len(kept) == 1:
            with np.load(file) as held:
                for kind, size in held["seen"]:
                    seen[str(kind), str(size)] = seen.get((str(kind), str(size)), 0) + 1

    def pooled_of(kind: str, what: str) -> Outcome:
        outcomes: dict[str, Outcome] = found["outcomes"][kind, what]
        return outcomes.get("all") or next(iter(outcomes.values()))

    before = FAMILIES[family].BASELINES
    text = _pages().get_template("family.md.j2").render(
        family=family, plan=plan, effort=plan["effort"], conclusions=conclusions(found),
        headline=headline(found), answers=found["answers"], unfinished=found["unfinished"],
        worlds=FAMILIES[family].WORLDS,
        control=CONTROL, kinds=KINDS, sets=TRAINED_ON, words=WORDS, groups=GROUPS, seen=seen,
        pooled_of=pooled_of,
        kept=f"The diagnosis gets {len(before)} recordings of the part from the acceptance, too."
        if before else "",
    )  # fmt: skip
    return text.strip()


def write_page(found: dict[str, Any], out: Path, page: Path) -> None:
    """Write a family's section of the page, and keep the other's; pictures go beside it."""
    pictures = page.parent / "pictures"
    pictures.mkdir(parents=True, exist_ok=True)
    sections = sections_of(page)
    sections[found["plan"]["family"]] = section(found, out, pictures)
    text = _pages().get_template("payoff.md.j2").render(
        sections=sections, begin=begin, end=end, aim=AIM, groups=GROUPS,
        settings=", ".join(f"{key} {value}" for key, value in SETTINGS.items()),
        flaw_points=FLAW_POINTS, plain_points=PLAIN_POINTS,
        channels=convolutional.CHANNELS, steps=convolutional.STEPS, batch=convolutional.BATCH,
        crop=convolutional.CROP,
        label_um=1e3 * LABEL_MM, apart_mm=APART_MM,
    )  # fmt: skip
    page.parent.mkdir(parents=True, exist_ok=True)
    page.write_text(text.rstrip() + "\n", encoding="utf-8")
