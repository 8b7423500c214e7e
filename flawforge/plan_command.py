"""`flawforge plan`: passes over a part that together see it."""

import argparse
from pathlib import Path

EPILOG = """\
Lays straight passes over the part from 26 directions, keeps those that together see --cover of the
surface in little length, and writes the poses of each, pass-00.h5 ..., which a recipe with as many
profiles follows: `motion: {path: pass-00.h5}`. Seen is what the laser sweeps within line and range,
at no more than 75° of incidence, with a free way to the laser and, where the triangulation angle is
stated, to the camera. The picture shows in red what no pass saw. Exit code 1 where --cover isn't
reached.

examples:
  flawforge plan bearing_cap --sensor KEYENCE-LJ-X8200 --angle 30 --out plan
  flawforge plan cad/door.stl --unit mm --sensor sensor.yaml --cover 0.9 --out plan
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's words."""
    parser.epilog = EPILOG
    parser.add_argument("part", metavar="PART", help="a mesh file, or a built-in part")
    parser.add_argument("--sensor", required=True, metavar="S", help="a preset or a sensor.yaml")
    parser.add_argument("--unit", default="mm", metavar="U", help="of the mesh (default mm)")
    parser.add_argument(
        "--angle", type=float, metavar="DEG", help="triangulation angle in place of the sensor's"
    )
    parser.add_argument(
        "--cover", type=float, default=0.98, metavar="SHARE", help="wanted (default 0.98)"
    )
    parser.add_argument(
        "--samples", type=int, default=4000, metavar="N", help="points looked at (default 4000)"
    )
    parser.add_argument(
        "--profiles", type=int, default=400, metavar="N", help="poses of a pass (default 400)"
    )
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder")


def run(arguments: argparse.Namespace) -> int:
    """Plan, write the passes, and say the trade."""
    from dataclasses import replace

    import h5py
    import numpy as np

    from pipeline.parts import builtin
    from pipeline.parts.part import load_part
    from pipeline.planning.cover import plan_cover
    from pipeline.planning.passes import Samples, candidates
    from pipeline.planning.picture import draw_plan
    from sensors.casting.scene import Scene
    from sensors.datasheet import Datasheet
    from sensors.typed_yaml import RecipeError

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
    if arguments.part in builtin.NAMES:
        part = builtin.build(arguments.part)
    else:
        part = load_part(arguments.part, unit=arguments.unit)
    scene = Scene(part.vertices_mm, part.faces)
    samples = Samples.of(part, scene, arguments.samples, np.random.default_rng(0))
    tried = list(candidates(samples, scene, sheet))
    if not any(one.seen.any() for one in tried):
        raise RecipeError("no pass sees anything of the part", where=arguments.part)
    plan = plan_cover(tried, arguments.cover)
    arguments.out.mkdir(parents=True, exist_ok=True)
    print(f"{len(tried)} passes tried see {plan.reachable:.1%} of {part.name}")
    print("passes  length, mm  seen     mean incidence")
    for k, (one, share, length, angle) in enumerate(
        zip(plan.passes, plan.coverage, plan.length_mm, plan.incidence_deg, strict=True)
    ):
        print(f"{k + 1:6}  {length:10.0f}  {share:6.1%}  {angle:6.1f}°")
        with h5py.File(arguments.out / f"pass-{k:02d}.h5", "w") as file:
            file["pose"] = one.poses(arguments.profiles)
    title = f"{part.name}, {sheet.name}: {len(plan.passes)} passes see {plan.coverage[-1]:.1%}"
    draw_plan(plan, samples, title, arguments.out / "plan.png")
    print(arguments.out / "plan.png")
    if plan.coverage[-1] < arguments.cover:
        print(f"warning: {arguments.cover:.0%} can't be seen by these passes; red in the picture")
        return 1
    return 0
