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

from defects.kind import Kind
from defects.kinds import KINDS
from defects.kinds.banked import Banked
from defects.seats.seat import Edge, HoleRim
from defects.surface.surface import Site
from pipeline.injection.flawed_part import Flaw, FlawedPart
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
SECTION = """\
The section across the middle, beside the groove that the diamond stylus of scratch tests leaves
where it is pressed in as deep (ASTM G171-03: a cone of 120° with a ball of radius 200 µm; elastic
recovery and pile-up left out)."""
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


TIP_MM, APEX_RAD = 0.2, np.deg2rad(120.0)
"""Tip radius and apex angle of the stylus of scratch tests (ASTM G171-03)."""


def stylus_mm(depth_mm: float, across_mm: np.ndarray) -> np.ndarray:
    """Return the groove of ASTM G171's stylus pressed in by `depth_mm`: ball, then cone, mm.

    The ball of radius R runs into the cone of apex angle A at R cos(A / 2) from the axis.
    """
    half = APEX_RAD / 2
    meet = TIP_MM * np.cos(half)
    x = np.abs(across_mm)
    ball = TIP_MM - np.sqrt(np.maximum(TIP_MM**2 - x**2, 0.0))
    cone = TIP_MM - TIP_MM * np.sin(half) + (x - meet) / np.tan(half)
    return np.minimum(np.where(x < meet, ball, cone) - depth_mm, 0.0)


def draw_section() -> tuple[float, float]:
    """Write docs/flaws/scratch-section.png; return width of both grooves at one depth, mm.

    The scratch has the middle of its typical sizes; the stylus is pressed in as deep.
    """
    sizes = {**middle("scratch"), "bow_deg": 0.0, "burr_side": 0.0}
    flawed = made("scratch", sizes)
    cutter, site = flawed.cutters[0], flawed.flaws[0]
    kind = KINDS["scratch"](**sizes)
    stations = np.unique(np.round(cutter.skin_mm @ _axis(site, 0.0), 9))
    at = cutter.skin_mm @ _axis(site, 0.0) - site.position_mm @ _axis(site, 0.0)
    near = np.abs(at) < 0.5 * float(np.median(np.diff(stations))) + 1e-6
    across = (cutter.skin_mm[near] - site.position_mm) @ _axis(site, np.pi / 2)
    height = cutter.height_mm[near]
    order = np.argsort(across)
    across, height = across[order], height[order]
    end = kind.width_mm / 2 * (1 + kind.burr_width)
    across, height = across[np.abs(across) <= end + 1e-6], height[np.abs(across) <= end + 1e-6]
    fine = np.linspace(-2 * end, 2 * end, 801)
    depth = float(-height.min())
    stylus = stylus_mm(depth, fine)
    wide = float(np.ptp(fine[stylus < 0]))
    figure = Figure(figsize=(8.4, 3.4), dpi=100, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.axhline(0.0, color="#22252B", linewidth=0.7)
    axes.plot(1e3 * fine, 1e3 * stylus, "--", color="#1F4E79",
              label="groove of ASTM G171's stylus (120°, R 200 µm), as deep")  # fmt: skip
    axes.plot(1e3 * across, 1e3 * height, color="#D1651F", linewidth=1.8,
              label="scratch, middle of the typical sizes")  # fmt: skip
    half, low = 1e3 * kind.width_mm / 2, 1e3 * height.min()
    axes.annotate("", (-half, 0.45 * low), (half, 0.45 * low), arrowprops={"arrowstyle": "<->"})
    axes.text(0, 0.42 * low, f"{2 * half:.0f} µm", ha="center", va="bottom", fontsize=9)
    axes.annotate("", (0.0, 0.0), (0.0, low), arrowprops={"arrowstyle": "<->"})
    axes.text(0.04 * half, 0.8 * low, f"{-low:.0f} µm", fontsize=9)
    axes.text(1e3 * end, 1.05e3 * height.max(), f"pile-up {1e3 * height.max():.1f} µm", fontsize=9)
    axes.set(xlabel="across, µm", ylabel="height, µm", ylim=(1.35 * low, -0.75 * low))
    axes.legend(fontsize=9, frameon=False, loc="upper left")
    figure.savefig(HERE / "scratch-section.png")
    return kind.width_mm, wide


def _axis(flaw: Flaw, angle: float) -> np.ndarray:
    site = Site(
        position_mm=flaw.position_mm, normal=flaw.normal, heading_rad=flaw.heading_rad,
        triangle=flaw.triangle,
    )  # fmt: skip
    return site.direction(angle)


def text() -> str:
    """Return the page."""
    lines = [
        "# Kinds of flaw",
        "",
        "Made by `make flaws` from the code; do not edit. A recipe lists kinds under `flaws:` and",
        "may set each size of a kind to a number or a distribution. Omitted sizes are drawn from",
        "the typical range (logarithmically for lengths). Pictures show the middle and the upper",
        "end of the typical ranges, with a light that emphasises shallow shapes, at different",
        "scales.",
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
        if name == Banked.name:
            lines += ["", "See [flaw-bank.md](flaw-bank.md).", "",
                      f"![{name}: one flaw, as it was and varied](flaws/{name}.png)"]  # fmt: skip
            continue
        lines += ["", f"![{name}, typical and severe](flaws/{name}.png)"]
        if name == "scratch":
            lines += ["", "![section of a scratch](flaws/scratch-section.png)", "", SECTION]
    cost = HERE / "cost.md"
    if cost.exists():
        lines += ["", "## Cost", "", cost.read_text(encoding="utf-8").rstrip()]
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
            if name != Banked.name:  # drawn by make_bank.py
                draw(name)
            if name == "scratch":
                print("widths, mm:", draw_section())


if __name__ == "__main__":
    main()
