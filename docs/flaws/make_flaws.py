"""Make docs/flaws.md and its pictures: every kind of flaw from the code, typical and severe.

Run `python docs/flaws/make_flaws.py` from the top of the checkout; `--text` leaves the pictures.
"""

import argparse
import inspect
from functools import cache
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from defects import KINDS
from defects.kind import Kind
from defects.seats import Edge, HoleRim
from pipeline.injection.flawed_part import FlawedPart
from pipeline.injection.flawplan import FlawPlan, exactly
from pipeline.injection.inject import inject
from pipeline.parts import builtin
from pipeline.parts.part import Part
from pipeline.preview.camera import Camera, render
from pipeline.seeds import streams
from sensors.casting.scene import Scene

HERE = Path(__file__).parent
STEEL = np.array([0.70, 0.73, 0.77])
STAGES = {
    "undercut": ("welded_plate", "toe"),
    "lack_of_fusion": ("welded_plate", "toe"),
    "porosity": ("welded_plate", "bead"),
    "spatter": ("steel_plate", "face"),
    "edge_chip": ("welded_plate", "plate"),
    "edge_burr": ("welded_plate", "plate"),
    "wear": ("welded_plate", "plate"),
    "missing_feature": ("bearing_cap", "boss"),
    "corrosion": ("steel_plate", "face"),
}
SEVERE = {"missing_feature": {"ratio": 1.35}, "edge_burr": {"root_mm": 0.25, "raggedness": 0.8}}


@cache
def stage(kind: str) -> tuple[Part, str]:
    """Return the part that a kind is shown on, and the region."""
    name, region = STAGES.get(kind, ("car_door", "outer"))
    part = builtin.build(name)
    return part, region if region in part.regions else "outer"


def middle(kind: str) -> dict[str, float]:
    """Return the middle of each typical range: geometric for lengths, whole where it must be."""
    return _sizes(KINDS[kind], 0.5)


def severe(kind: str) -> dict[str, float]:
    """Return sizes at the upper end of the typical ranges of lengths, ratios in the middle."""
    return {**_sizes(KINDS[kind], 1.0), **SEVERE.get(kind, {})}


def _sizes(kind: type[Kind], share: float) -> dict[str, float]:
    found = {}
    for size in kind.sizes():
        low, high = size.typical
        if size.unit == "mm" and low > 0:
            value = low ** (1 - share) * high**share
        else:
            value = 0.5 * (low + high)
        found[size.name] = float(round(value)) if size.whole else value
    return found


def made(kind: str, sizes: dict[str, float]) -> FlawedPart:
    """Cut one flaw with the given sizes into its stage."""
    part, region = stage(kind)
    plan = FlawPlan(kinds=(exactly(kind, 1, **sizes),), where=(region,))
    for seed in range(5, 60):
        flawed = inject(part, plan, rng_of=streams(seed, kind))
        if flawed.flaws and flawed.flaws[0].normal[2] > 0.3:
            return flawed
    raise RuntimeError(f"{kind}: no place found")


def picture(flawed: FlawedPart) -> np.ndarray:
    """Shade the surroundings of a flaw, lit so that shallow shapes show."""
    flaw = flawed.flaws[0]
    cutter = flawed.cutters[0]
    own = flawed.vertices_mm[flawed.faces[flawed.instance == 1]].reshape(-1, 3)
    if isinstance(KINDS[flaw.kind].seat, HoleRim):
        own = np.concatenate([own, flaw.position_mm + 12.0 * np.vstack([np.eye(3), -np.eye(3)])])
    side = np.array([0.35, 0.8, 0.0])
    if isinstance(KINDS[flaw.kind].seat, Edge):
        along = np.cross(flaw.normal, [0.0, 0.0, 1.0])
        side = 0.5 * along / max(float(np.linalg.norm(along)), 1e-9)
    if flaw.kind == "edge_burr":  # a fin is seen from near, and from low down
        own = own[np.linalg.norm(own - flaw.position_mm, axis=1) < 1.6]
        side = 2.2 * side - 0.5 * np.array([0.0, 0.0, 1.0])
    look = -flaw.normal + side
    up = np.array([0, 0, 1.0]) if abs(look[2]) < 0.95 * np.linalg.norm(look) else np.eye(3)[1]
    camera = Camera.around(own, look=look, up=up, pixels=(660, 440), margin=0.12)
    colours = np.broadcast_to(STEEL, (len(flawed.faces), 3))
    scene = Scene(flawed.vertices_mm, flawed.faces)
    assert len(cutter.solids)
    return render(scene, camera, colours, relief=True, groups=flawed.instance)


def draw(kind: str) -> None:
    """Write docs/flaws/KIND.png: the middle of the typical sizes and a severe one."""
    figure = Figure(figsize=(9.2, 3.4), dpi=100, facecolor="white")
    FigureCanvasAgg(figure)
    for at, (word, sizes) in enumerate((("typical", middle(kind)), ("severe", severe(kind)))):
        flawed = made(kind, sizes)
        flaw = flawed.flaws[0]
        axes = figure.add_subplot(1, 2, at + 1)
        axes.imshow(picture(flawed))
        what = "high" if flaw.removed_mm3 == 0 else "deep"
        axes.set_title(f"{word}: {flaw.depth_mm:.2g} mm {what}", fontsize=11)
        axes.set_axis_off()
    figure.tight_layout()
    figure.savefig(HERE / f"{kind}.png")


def text() -> str:
    """Return the page."""
    lines = [
        "# Kinds of flaw",
        "",
        "Made by `make flaws` from the code; do not edit. A recipe names a kind under `flaws:` and",
        "may set each of its sizes to a number or a distribution; sizes left out are drawn from",
        "the typical range (logarithmically for lengths). Pictures show the middle of the typical",
        "ranges and their upper end, lit so that shallow shapes show; they are not to one scale.",
        "",
        "| kind | class | where it sits |",
        "| --- | --- | --- |",
    ]
    for name, kind in KINDS.items():
        seat = kind.seat
        where = "skin"
        if isinstance(seat, Edge):
            where = "outer edges" if seat.convex else "inner edges (weld toes)"
        elif isinstance(seat, HoleRim):
            where = "round holes"
        lines.append(f"| [{name}](#{name}) | {kind.class_id} | {where} |")
    for name, kind in KINDS.items():
        summary = inspect.cleandoc(kind.__doc__ or "")
        lines += ["", f"## {name}", "", summary, "", "| size | meaning | allowed | typical |",
                  "| --- | --- | --- | --- |"]  # fmt: skip
        for size in kind.sizes():
            low, high = size.typical
            typical = f"{low:g}" if low == high else f"{low:g} to {high:g}"
            lines.append(f"| `{size.name}` | {size.meaning} | {size.allowed} | {typical} |")
        lines += ["", f"![{name}, typical and severe](flaws/{name}.png)"]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write the page, and the pictures unless told not to."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--text", action="store_true", help="leave the pictures as they are")
    parser.add_argument("names", nargs="*", help="kinds to draw; all where none is named")
    wanted = parser.parse_args()
    (HERE.parent / "flaws.md").write_text(text(), encoding="utf-8")
    if not wanted.text:
        for name in wanted.names or KINDS:
            draw(name)


if __name__ == "__main__":
    main()
