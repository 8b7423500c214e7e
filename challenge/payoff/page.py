"""The page of the payoff: three sets of training data, one test, what is gained."""

from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from challenge.payoff.flaws import RANGES
from challenge.payoff.payoff import CONTROL
from challenge.payoff.pictures import draw_examples, draw_precision
from challenge.payoff.precision import GROUPS, Estimate
from challenge.payoff.segmenter import FLAW_POINTS, PLAIN_POINTS, SETTINGS
from challenge.payoff.specimens import APART_MM, LABEL_MM
from challenge.payoff.worlds import WORLDS


def _figure(value: Estimate | None, digits: int = 3) -> str:
    if value is None:
        return "gap not sure"
    return f"{value.value:.{digits}f} ({value.low:.{digits}f} to {value.high:.{digits}f})"


def _range(name: tuple[str, str]) -> str:
    length, width, depth = RANGES[name]
    across = "" if length == width else f" × {width[0]:g}-{width[1]:g}"
    return f"{length[0]:g}-{length[1]:g}{across} mm, {1e3 * depth[0]:g}-{1e3 * depth[1]:g} µm deep"


def headline(found: dict[str, Any]) -> list[str]:
    """Return the table of worlds, for points and for flaws."""
    lines: list[str] = []
    for what in ("points", "flaws"):
        lines += [
            f"| {what}: world | plain | diagnosed | instrument | gap | share of it closed |",
            "| --- | --- | --- | --- | --- | --- |",
        ]
        for name, result in found[what].items():
            label = "**mean without the control**" if name == "all" else name
            means = " | ".join(_figure(m, 2) for m in result.mean())
            lines.append(
                f"| {label} | {means} | {_figure(result.gap())} | {_figure(result.closed(), 2)} |"
            )
        lines.append("")
    return lines


def conclusion(found: dict[str, Any]) -> str:
    """Say in one sentence whether the aim is met."""
    result = found["points"].get("all")
    if result is None:
        return "Only the control was run."
    closed = result.closed()
    if closed is None:
        return "The mean gap between nominal simulation and instrument is not significant."
    word = "met" if closed.value >= 0.5 else "missed"
    if word == "met" and closed.low < 0.5:
        word = "met, though the interval reaches below"
    return (
        f"Over the worlds, diagnosed simulation closes {closed.value:.0%} of the gap in average "
        f"precision of points (95 % interval {closed.low:.0%} to {closed.high:.0%}). The aim, at "
        f"least half, is {word}."
    )


def write_page(found: dict[str, Any], out: Path, page: Path) -> None:
    """Write the page; pictures go into ``pictures/`` beside it."""
    plan = found["plan"]
    pictures = page.parent / "pictures"
    pictures.mkdir(parents=True, exist_ok=True)
    kept = {name: out / name / "tallies.npz" for name in plan["worlds"]}
    draw_precision(found["points"], pictures / "payoff-precision.png")
    draw_examples(kept, pictures / "payoff-examples.png")
    seen: dict[tuple[str, str], int] = {}
    for name, file in kept.items():
        if name != CONTROL or len(kept) == 1:
            with np.load(file) as held:
                for kind, size in held["seen"]:
                    seen[str(kind), str(size)] = seen.get((str(kind), str(size)), 0) + 1
    shown = found["points"].get("all") or next(iter(found["points"].values()))
    flaws = found["flaws"].get("all") or next(iter(found["flaws"].values()))
    pages = Environment(
        loader=PackageLoader("challenge", "payoff"), undefined=StrictUndefined,
        keep_trailing_newline=True, autoescape=False,
    )  # fmt: skip
    pages.filters |= {"figure": _figure, "sizes": _range}
    text = pages.get_template("payoff.md.j2").render(
        seed=plan["seed"], effort=plan["effort"], conclusion=conclusion(found),
        headline=headline(found), answers=found["answers"], worlds=WORLDS, control=CONTROL,
        points=shown, flaws=flaws, groups=GROUPS, seen=seen,
        settings=", ".join(f"{key} {value}" for key, value in SETTINGS.items()),
        flaw_points=FLAW_POINTS, plain_points=PLAIN_POINTS,
        label_um=1e3 * LABEL_MM, apart_mm=APART_MM,
    )  # fmt: skip
    page.parent.mkdir(parents=True, exist_ok=True)
    page.write_text(text.rstrip() + "\n", encoding="utf-8")
