"""The page of a POD study: curves with their bounds, the estimates, how it was done."""

import base64
import io
import json
from importlib import resources
from pathlib import Path
from typing import Any, Final

import numpy as np

from files.whole_file import write_whole
from pipeline.pod.curve import CONFIDENCE, Curve
from pipeline.pod.study import Group, Study

GRID: Final = 41  # sizes at which a curve is drawn
BINS: Final = 8  # of the observed shares


def write_page(study: Study, out: Path) -> dict[str, Any]:
    """Write the page, and beside it the same as JSON and PNG; return the JSON."""
    from jinja2 import Environment, StrictUndefined

    facts = _facts(study)
    picture = _picture(study)
    template = (resources.files("pipeline.pod") / "page.html.j2").read_text(encoding="utf-8")
    page = Environment(undefined=StrictUndefined, autoescape=True).from_string(template)
    html = page.render(study=study, facts=facts, picture=base64.b64encode(picture).decode())
    out.parent.mkdir(parents=True, exist_ok=True)
    write_whole(out, html)
    write_whole(out.with_suffix(".json"), json.dumps(facts, indent=1) + "\n")
    write_whole(out.with_suffix(".png"), picture)
    return facts


def _facts(study: Study) -> dict[str, Any]:
    groups = []
    for group in study.groups:
        methods: dict[str, dict[str, Any]] = {}
        for method, curve in group.curves.items():
            if isinstance(curve, str):
                methods[method] = {"not_estimable": curve}
                continue
            found = curve.estimate()
            methods[method] = {"a50": found.a50, "a90": found.a90, "a90_95": found.a90_95}
        groups.append(
            {
                "kind": group.name,
                "flaws": group.flaws,
                "looks": len(group.size),
                "found": int(group.hit.sum()),
                "methods": methods,
            }
        )
    return {
        "format": "flawforge-pod",
        "version": 1,
        "detector": study.detector,
        "size": study.size_column,
        "threshold": study.threshold,
        "link": study.link,
        "split": study.split,
        "confidence": CONFIDENCE,
        "left_out": study.left_out,
        "groups": groups,
    }


def _picture(study: Study) -> bytes:
    from matplotlib.figure import Figure

    count = len(study.groups)
    wide = min(count, 3)
    rows = -(-count // wide)
    figure = Figure(figsize=(4.6 * wide, 3.5 * rows), layout="constrained")
    for k, group in enumerate(study.groups):
        _draw(figure.add_subplot(rows, wide, k + 1), group, study)
    handle = io.BytesIO()
    figure.savefig(handle, format="png", dpi=110, metadata={"Software": None})
    return handle.getvalue()


COLOURS: Final = {"hit/miss": "#1f5fa8", "signal response": "#c0561a"}


def _draw(axes: Any, group: Group, study: Study) -> None:
    from matplotlib.ticker import LogLocator, NullFormatter

    low, high = group.size.min(), group.size.max()
    if low == high:
        low, high = low / 2, high * 2
    grid = np.geomspace(low, high, GRID)
    for method, curve in group.curves.items():
        if not isinstance(curve, Curve):
            continue
        colour = COLOURS[method]
        axes.plot(grid, curve.pod(grid), color=colour, label=method, lw=1.8)
        lower = [curve.lower_pod(float(size)) for size in grid]
        axes.plot(grid, lower, color=colour, ls="--", lw=1.0)
        found = curve.estimate()
        if found.a90_95 is not None and low <= found.a90_95 <= high:
            axes.plot([found.a90_95], [0.9], marker="v", color=colour, ms=7, zorder=5)
    order = np.argsort(group.size)
    for part in np.array_split(order, min(BINS, max(len(order) // 5, 1))):
        if part.size:
            axes.plot(
                [np.exp(np.log(group.size[part]).mean())], [group.hit[part].mean()], "o", ms=5,
                mfc="white", mec="0.3", zorder=4,
            )  # fmt: skip
    axes.axhline(0.9, color="0.8", lw=0.8, zorder=0)
    axes.set_xscale("log")
    span = np.log10(high / low)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0,) if span > 2 else (1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_ylim(-0.03, 1.03)
    title = f"{group.name}: {int(group.hit.sum())} of {len(group.size)} found"
    axes.set_title(title, fontsize=10, parse_math=False)  # a kind's name is no formula
    label = study.size_column.removeprefix("size_").replace("_mm", ", mm")
    axes.set_xlabel(label.replace("_", " "), parse_math=False)
    axes.set_ylabel("probability of detection")
    if any(isinstance(curve, Curve) for curve in group.curves.values()):
        axes.legend(fontsize=8, loc="lower right", framealpha=0.8)
    else:
        why = next(iter(group.curves.values()))
        axes.text(0.5, 0.5, str(why), transform=axes.transAxes, ha="center", wrap=True, fontsize=8)


