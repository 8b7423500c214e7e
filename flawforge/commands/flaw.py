"""`flawforge flaw`: a bank of real flaws from recordings."""

import argparse
import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from flawforge.flaw.extraction import Region

EPILOG = """\
Registers the recording on its part and extracts the flaw's relief (measured minus nominal, along
the local normal). Levels the relief by the rim around the region and denoises it with the
recording's noise. Writes BANK/NAME.npz with mask, dimensions and origin, and the picture
BANK/NAME.png.

A recipe puts variations of the bank's flaws on other parts:
  flaws: {bank: {path: bank, number: 2, scale: {uniform: [0.5, 2]}, mirror: true}}

examples:
  flawforge flaw extract a.h5 --part part.stl --sensor sensor.yaml --region 12,-4,19,3 --out bank
  flawforge flaw extract a.h5 --part part.stl --sensor sensor.yaml --region 40:90,300:420 --out bank
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's words."""
    parser.epilog = EPILOG
    steps = parser.add_subparsers(dest="step", metavar="STEP", required=True)
    extract = steps.add_parser(
        "extract", help="extract one flaw from a recording", epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    extract.add_argument("recording", type=Path, metavar="REC.h5", help="recording with the flaw")
    extract.add_argument(
        "--part", type=Path, required=True, help="closed mesh of the part without the flaw"
    )
    extract.add_argument(
        "--part-unit", default="mm", choices=("mm", "cm", "m", "inch", "um"),
        help="unit of the mesh's coordinates (default: mm)",
    )  # fmt: skip
    extract.add_argument("--sensor", required=True, help="the sensor's YAML file, or a preset")
    extract.add_argument(
        "--region", required=True, metavar="X0,Y0,X1,Y1 | R0:R1,C0:C1",
        help="around the flaw: a box in the part's x and y, mm; or profiles and points, half-open",
    )  # fmt: skip
    extract.add_argument(
        "--out", type=Path, required=True, metavar="BANK", help="folder of the bank"
    )
    extract.add_argument(
        "--name", help="name of the flaw (default: that of the recording, with profile and point)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Extract, write, draw, and print the dimensions."""
    from files.errors import RecipeError
    from files.whole_file import whole
    from flawforge.flaw.extraction import extract
    from flawforge.flaw.picture import draw
    from pipeline.parts.part import load_part
    from sensors.datasheet import Datasheet
    from sensors.recording import Recording

    recording = Recording.load(arguments.recording)
    region = parse_region(arguments.region, recording.depth_mm.shape)
    name = arguments.name or f"{recording.name}-{re.sub(r'[^0-9]+', '-', arguments.region)}"
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}", name):
        raise RecipeError(
            "not a file name", where="--name", value=name,
            allowed="letters, digits, '.', '_' and '-'",
        )  # fmt: skip
    part = load_part(arguments.part, unit=arguments.part_unit)
    found = extract(recording, part, Datasheet.load(arguments.sensor), region, name)
    arguments.out.mkdir(parents=True, exist_ok=True)
    with whole(arguments.out / f"{name}.npz") as aside:
        found.relief.save(aside)
    draw(found, arguments.out / f"{name}.png")
    size = found.relief.dimensions()
    print(
        f"{name}: {size['length_mm']:.3g} x {size['width_mm']:.3g} mm, "
        f"{1e3 * size['depth_mm']:.3g} µm deep, {1e3 * size['height_mm']:.3g} µm high; "
        f"{size['removed_mm3']:.3g} mm³ removed, {size['added_mm3']:.3g} mm³ added; "
        f"noise {1e3 * found.noise.sd_mm:.3g} µm, denoised {1e3 * found.denoised.sd_mm:.3g} µm"
    )
    print(f"wrote {arguments.out / name}.npz and .png")
    return 0


def parse_region(text: str, shape: tuple[int, ...]) -> "Region":
    """Read a box in mm, or ranges of profiles and points.

    Raises
    ------
    RecipeError
        Where it is neither, or lies outside the scan.
    """
    from files.errors import RecipeError
    from flawforge.flaw.extraction import Region
    from flawforge.region import parse_ranges

    if ":" in text:
        return Region(ranges=parse_ranges(text, shape))
    try:
        x0, y0, x1, y1 = (float(number) for number in text.split(","))
    except ValueError:
        x0 = x1 = 0.0
        y0 = y1 = 0.0
    if not (x0 < x1 and y0 < y1):
        raise RecipeError(
            "--region: wrong form", value=text,
            allowed="x0,y0,x1,y1 in mm, the least first, or "
            f"R0:R1,C0:C1 within 0:{shape[0]},0:{shape[1]}",
        )  # fmt: skip
    return Region(box_mm=(x0, y0, x1, y1))
