"""The page of the payoff: three sets of training data, one test, what is gained."""

from pathlib import Path
from typing import Any

import numpy as np

from challenge.payoff.flaws import RANGES
from challenge.payoff.gap import Outcome
from challenge.payoff.payoff import CONTROL
from challenge.payoff.pictures import draw_examples, draw_precision
from challenge.payoff.precision import GROUPS, Estimate
from challenge.payoff.segmenter import FLAW_POINTS, PLAIN_POINTS, SETTINGS
from challenge.payoff.specimens import APART_MM, LABEL_MM
from challenge.payoff.worlds import WORLDS

_PROTOCOL = """\
## What is compared

One small flaw segmenter is trained on scans that come from

- **plain**: `flawforge generate` with the maker's `sensor.yaml` and the roughness measured on a
  plate when the instrument was accepted;
- **diagnosed**: the same with the `sensor.yaml` that `flawforge diagnose` wrote, from three
  recordings of the clean part by the instrument as it is now;
- **instrument**: the virtual instrument itself (`challenge/`), which the other two never saw with
  a flaw. That is the upper bound.

The three share the very same flawed solids, paths, labels, drawn points, hyperparameters and seeds:
only the renderer differs. Flaws are cut into the solid (dents, pits, scratches, cracks); a point
belongs to one where rays alone say that the surface lies {label:.0f} µm deeper. The test is on
other specimens, scanned by the instrument; its files are committed to by SHA-256 before
the first diagnosis and opened after the last training. Each segmenter draws half of {training}
training specimens; {seeds} are trained on each set, and tested on {test} recordings of each world.

The segmenter: scikit-learn's `HistGradientBoostingClassifier` ({settings}) on differences
of smoothed depth, curvatures, slopes, spread, share of missing points and what a profile or column
shares, at scales of 1 to 8 points; {flaw} points on flaws and {plain} others of a scan at most. It
sees the depth alone. All of this was fixed on other seeds.

*Points*: each point is ranked by its suspicion; a group's points against all points without a flaw.
*Flaws*: local maxima of the suspicion are alarms; a flaw counts by the highest alarm on it, and an
alarm on none is false. The mean is over the {groups} groups (kind and size), so that large dents
don't decide. Intervals (95 %) are a bootstrap over test recordings and seeds, the same draws for
the three; the share of the gap is given where the gap's interval is above zero.
"""
_DOUBTS = """\
## What a sceptic should doubt

- Every world is one instrument and one part with one strong departure from the maker's word. The
  intervals say nothing about other instruments; another seed draws others.
- The three sets are equally large. A simulation could make a hundred times as many scans as an
  instrument; what that would buy isn't shown.
- Plain simulation lacks more than the world's switch: its noise is a Perlin field with the plate's
  figures, no speckle. The control shows what that costs alone; where the control has a gap, part
  of a world's gap isn't the switch's.
- The reference plates are scanned by the instrument as it was accepted, on plain matt plates. With
  plates of the day the simulated noise would be another.
- In `print` the drawing of the print is given to both simulations: plain simulation has no use for
  it. The segmenter sees no brightness, with which prints would be easy.
- The segmenter is small and sees 8 points around. A deep network may gain more from realism, or
  less.
- Flaws are analytic solids without raised rims, cut along the view, away from the part's edges.
  Their sizes are drawn alike for training and test: nobody tells us the real statistics so well.
- The part lies where the poses say, within rounding.
"""


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


def _worlds(found: dict[str, Any]) -> list[str]:
    lines = ["| world | what is so | verdict | effects found |", "| --- | --- | --- | --- |"]
    for name, answer in found["answers"].items():
        effects = ", ".join(answer["effects"]) or "-"
        lines.append(f"| {name} | {WORLDS[name].words} | {answer['verdict']} | {effects} |")
    return lines


def _groups(result: Outcome, what: str, seen: dict[tuple[str, str], int]) -> list[str]:
    lines = [
        f"| {what}: kind and size | in the test | plain | diagnosed | instrument "
        "| share of the gap closed |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    values = result.groups.mean(1)
    for k, name in enumerate(GROUPS):
        three = " | ".join(f"{v:.2f}" for v in values[:, k])
        lines.append(
            f"| {name[0]}, {name[1]} ({_range(name)}) | {seen.get(name, 0)} | {three} "
            f"| {_figure(result.closed(k), 2)} |"
        )
    return lines


def conclusion(found: dict[str, Any]) -> str:
    """Say in one sentence whether the aim is met."""
    result = found["points"].get("all")
    if result is None:
        return "Only the control was run."
    closed = result.closed()
    if closed is None:
        return "Over the worlds the gap between plain simulation and instrument may be chance."
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
    settings = ", ".join(f"{k} {v}" for k, v in SETTINGS.items())
    effort = plan["effort"]
    lines = [
        "# Does a diagnosis help in the end?",
        "",
        f"Written by `make payoff`. Master seed: {plan['seed']}.",
        "",
        conclusion(found),
        "",
        *headline(found),
        "![Average precision](pictures/payoff-precision.png)",
        "",
        "## The worlds",
        "",
        *_worlds(found),
        "",
        f"Everything missing is strong. `{CONTROL}` is the control: there the maker's word is all "
        "there is to say.",
        "",
        "![Sealed recordings](pictures/payoff-examples.png)",
        "",
        "## By kind and size",
        "",
        "Means over the worlds without the control.",
        "",
        *_groups(shown, "points", seen),
        "",
        *_groups(flaws, "flaws", seen),
        "",
        _PROTOCOL.format(
            label=1e3 * LABEL_MM, groups=len(GROUPS), flaw=FLAW_POINTS, plain=PLAIN_POINTS,
            settings=settings, **effort,
        ),  # fmt: skip
        f"Rims of flaws are {APART_MM:g} mm apart and from edges. Points of a rim shallower than "
        f"{1e3 * LABEL_MM:.0f} µm count neither way.",
        "",
        _DOUBTS,
    ]
    page.parent.mkdir(parents=True, exist_ok=True)
    page.write_text("\n".join(lines).rstrip() + "\n")
