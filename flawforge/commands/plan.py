"""`flawforge plan`: passes over a part that together cover it."""

import argparse
from pathlib import Path

EPILOG = """\
Tries straight passes over the part from 26 directions and selects a short plan that covers the
share --cover of the surface. pass-00.h5 ... hold the poses of each pass; a recipe with as many
profiles follows one with `motion: {path: pass-00.h5}`. A point is seen if the laser sweeps it
within line and range, at an incidence of at most 75°, and if nothing blocks the line of sight to
the laser and, with a stated triangulation angle, to the camera. The picture shows unseen points
in red. The table compares plans by length and coverage; * marks the Pareto front. pit is the
depth at which a matched filter finds a pit 2 mm wide at a signal-to-noise ratio of 5, median over
the points seen. Exit code 1 where --cover is not reached.

examples:
  flawforge plan bearing_cap --sensor KEYENCE-LJ-X8200 --angle 30 --surface steel_plate --out plan
  flawforge plan cad/door.stl --unit mm --sensor sensor.yaml --cover 0.9 --out plan
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's words."""
    parser.epilog = EPILOG
    parser.add_argument("part", metavar="PART", help="a mesh file, or a built-in part")
    parser.add_argument("--sensor", required=True, metavar="S", help="a preset or a sensor.yaml")
    parser.add_argument("--unit", default="mm", metavar="U", help="unit of the mesh (default mm)")
    parser.add_argument(
        "--angle", type=float, metavar="DEG", help="triangulation angle in place of the sensor's"
    )
    parser.add_argument(
        "--surface", metavar="S", help="roughness: a preset or a file (default none)"
    )
    parser.add_argument(
        "--cover",
        type=float,
        default=0.98,
        metavar="SHARE",
        help="share of the surface to cover (default 0.98)",
    )
    parser.add_argument(
        "--samples",
        type=int,
        default=4000,
        metavar="N",
        help="sample points on the surface (default 4000)",
    )
    parser.add_argument(
        "--profiles", type=int, default=400, metavar="N", help="poses per pass (default 400)"
    )
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder to write")


def run(arguments: argparse.Namespace) -> int:
    """Plan, write the passes, and print the plans."""
    from dataclasses import replace

    import numpy as np

    from files.errors import RecipeError
    from files.hdf5_output import created
    from pipeline.parts import builtin
    from pipeline.parts.part import load_part
    from pipeline.passes.pareto import front, trade
    from pipeline.passes.picture import draw_plan
    from pipeline.passes.reference_flaw import ReferencePit
    from pipeline.passes.straight_passes import Samples, candidates
    from sensors.casting.scene import Scene
    from sensors.datasheet import Datasheet
    from sensors.surface.surface import Surface

    for word, low, high in (("cover", 0, 1), ("samples", 100, 10**6), ("profiles", 2, 10**6)):
        if not low < getattr(arguments, word) <= high:
            raise RecipeError(
                "out of bounds", where=f"--{word}", value=getattr(arguments, word),
                allowed=f"above {low}, at most {high}",
            )  # fmt: skip
    if arguments.angle is not None and not 0 < arguments.angle < 90:
        raise RecipeError(
            "out of bounds", where="--angle", value=arguments.angle, allowed="above 0, below 90"
        )
    sheet = Datasheet.load(arguments.sensor)
    if arguments.angle is not None:
        sheet = replace(sheet, triangulation_angle_deg=arguments.angle)
    surface = Surface.load(arguments.surface) if arguments.surface is not None else None
    if arguments.part in builtin.NAMES:
        part = builtin.build(arguments.part)
    else:
        part = load_part(arguments.part, unit=arguments.unit)
    scene = Scene(part.vertices_mm, part.faces)
    samples = Samples.of(part, scene, arguments.samples, np.random.default_rng(0))
    tried = list(candidates(samples, scene, sheet))
    if not any(one.seen.any() for one in tried):
        raise RecipeError("no pass sees the part", where=arguments.part)
    plans = trade(tried, arguments.cover)
    plan, optimal = plans[0], front(plans)
    pit = ReferencePit(datasheet=sheet, surface=surface, profiles=arguments.profiles)
    arguments.out.mkdir(parents=True, exist_ok=True)
    print(f"{len(tried)} passes tried see {plan.reachable:.1%} of {part.name}")
    print("passes  length, mm  seen     mean incidence  pit, µm")
    for one, best in sorted(zip(plans, optimal, strict=True), key=lambda p: p[0].length_mm[-1]):
        if not best and one is not plan:
            continue
        depths = np.min([pit.depths_mm(each) for each in one.passes], axis=0)
        marks = " *" * bool(best) + " written" * (one is plan)
        print(
            f"{len(one.passes):6}  {one.length_mm[-1]:10.0f}  {one.coverage[-1]:6.1%}"
            f"  {one.incidence_deg[-1]:13.1f}°  {1000 * np.median(depths[one.seen]):7.3g}{marks}"
        )
    print("*: Pareto front of length against coverage")
    for k, each in enumerate(plan.passes):
        with created(arguments.out / f"pass-{k:02d}.h5") as file:
            file["pose"] = each.poses(arguments.profiles)
    title = f"{part.name}, {sheet.name}: {len(plan.passes)} passes see {plan.coverage[-1]:.1%}"
    draw_plan(plan, plans, samples, title, arguments.out / "plan.png")
    print(arguments.out / "plan.png")
    if plan.coverage[-1] < arguments.cover:
        print(f"warning: {arguments.cover:.0%} cannot be seen by these passes; red in the picture")
        return 1
    return 0
