"""Make the pictures of the README and the docs: parts, flaws, set-up, full scan.

Run `python docs/pictures/make_pictures.py` from the top of the checkout.
"""

import tempfile
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pipeline.batch.run import generate
from pipeline.injection.flawed_part import FlawedPart
from pipeline.injection.flawplan import FlawPlan, exactly
from pipeline.injection.inject import inject
from pipeline.parts import builtin as parts
from pipeline.parts.part import Part
from pipeline.preview.camera import Camera, render
from pipeline.preview.recipe_picture import draw_recipe
from pipeline.preview.scan_picture import draw_scan
from pipeline.recipe import Recipe
from pipeline.seeds import streams
from sensors.casting.scene import Scene

HERE = Path(__file__).parent
RECIPES = HERE.parents[1] / "manifests"
STEEL = np.array([0.70, 0.73, 0.77])
FLAWS = {
    "dent": {"length_mm": 16.0, "depth_mm": 1.0},
    "crack": {"length_mm": 16.0, "width_mm": 0.5, "depth_mm": 0.6},
    "pit": {},
    "scratch": {"length_mm": 18.0},
    "bump": {"length_mm": 5.0, "height_mm": 1.0},
}


def picture_of(vertices_mm: np.ndarray, faces: np.ndarray, look: tuple[float, ...], **more):
    """Shade a mesh seen along `look`."""
    camera = Camera.around(
        more.pop("shown", vertices_mm), look=np.array(look), up=np.array([0, 0, 1.0]),
        pixels=(900, 560),
    )  # fmt: skip
    colours = np.broadcast_to(STEEL, (len(faces), 3))
    return render(Scene(vertices_mm, faces), camera, colours, **more)


def save(name: str, pictures: dict[str, np.ndarray], columns: int) -> None:
    """Write pictures side by side with their names."""
    rows = -(-len(pictures) // columns)
    figure = Figure(figsize=(4.6 * columns, 3.15 * rows), dpi=100, facecolor="white")
    FigureCanvasAgg(figure)
    for at, (title, image) in enumerate(pictures.items()):
        axes = figure.add_subplot(rows, columns, at + 1)
        axes.imshow(image)
        axes.set_title(title, fontsize=11)
        axes.set_axis_off()
    figure.tight_layout()
    figure.savefig(HERE / name)


def part_pictures() -> dict[str, np.ndarray]:
    """Show the three built-in parts."""
    shown = {}
    for name, look in (
        ("bearing_cap", (0.5, 0.8, -0.6)),
        ("car_door", (0.25, 0.55, -0.8)),
        ("steel_plate", (0.5, 0.8, -0.6)),
    ):
        part = parts.build(name)
        size = np.ptp(part.bounds_mm, axis=0)
        title = f"{name}: " + " × ".join(f"{length:.0f}" for length in size) + " mm"
        shown[title] = picture_of(part.vertices_mm, part.faces, look)
    return shown


def flawed(part: Part, kind: str, seed: int) -> FlawedPart:
    """Cut one flaw of a kind into a part."""
    plan = FlawPlan(kinds=(exactly(kind, 1, **FLAWS[kind]),), where=("outer",))
    return inject(part, plan, rng_of=streams(seed, kind))


def flaw_pictures() -> dict[str, np.ndarray]:
    """Show each kind of flaw close up, on the door's skin."""
    part = parts.build("car_door")
    shown = {}
    for kind in FLAWS:
        one = flawed(part, kind, 5)
        flaw = one.flaws[0]
        own = one.vertices_mm[one.faces[one.instance == 1]].reshape(-1, 3)
        look = -flaw.normal + 0.5 * np.array([0.4, 0.9, 0.0])
        shown[f"{kind}, {flaw.depth_mm:.2f} mm"] = picture_of(
            one.vertices_mm, one.faces, tuple(look), shown=own, relief=True, groups=one.instance
        )
    return shown


def main() -> None:
    """Make all pictures."""
    save("parts.png", part_pictures(), 3)
    save("flaws.png", flaw_pictures(), 3)
    draw_recipe("quickstart", HERE / "setup.png")
    with tempfile.TemporaryDirectory() as folder:
        generate(Recipe.load(RECIPES / "paper-figure6.yaml"), Path(folder) / "figure6")
        draw_scan(Path(folder) / "figure6", HERE / "full-scan.png")


if __name__ == "__main__":
    main()
