"""`flawforge import`: turn an instrument's file into recording.h5 and a sensor.yaml for it."""

import argparse
from pathlib import Path

EPILOG = """\
Readings stay on the instrument's own grid; nothing is resampled or filled. Heights above the
instrument's zero become depth = working distance - height. The part frame of the recording is the
instrument's: x along the columns, y along the rows, z up.

examples:
  flawforge import scan.npy --as scan.h5 --unit um --pitch-x-mm 0.1 --pitch-y-mm 0.2
  flawforge import matrix.csv --as scan.h5 --pitch-x-mm 0.1 --pitch-y-mm 0.2
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's words."""
    parser.epilog = EPILOG
    parser.add_argument("file", type=Path, metavar="FILE", help="what the instrument wrote")
    parser.add_argument(
        "--as", dest="target", type=Path, metavar="REC.h5", required=True, help="recording to write"
    )
    parser.add_argument("--unit", help="unit of the readings: mm, um, nm, m, cm, in")
    parser.add_argument("--pitch-x-mm", type=float, metavar="MM", help="distance of the columns")
    parser.add_argument("--pitch-y-mm", type=float, metavar="MM", help="distance of the rows")
    parser.add_argument("--working-distance-mm", type=float, metavar="MM")
    parser.add_argument("--rate-hz", type=float, metavar="HZ", help="profiles per second")
    parser.add_argument("--readings", choices=("height", "depth"), default="height")
    parser.add_argument("--travel", choices=("+y", "-y"), default="+y")
    parser.add_argument("--keep-repeated", action="store_true")
    parser.add_argument("--name", help="name of the recording (default: the file's)")
    parser.add_argument("--sensor-out", type=Path, metavar="YAML")


def run(arguments: argparse.Namespace) -> int:
    """Import; say what was made."""
    import numpy as np

    from sensors.formats import read_height_map
    from sensors.formats.conversion import Setup, convert

    heights = read_height_map(arguments.file, arguments.unit)
    done = convert(
        heights,
        Setup(
            name=arguments.name or arguments.file.stem,
            pitch_x_mm=arguments.pitch_x_mm,
            pitch_y_mm=arguments.pitch_y_mm,
            working_distance_mm=arguments.working_distance_mm,
            rate_hz=arguments.rate_hz,
            readings=arguments.readings,
            travel=arguments.travel,
            keep_repeated=arguments.keep_repeated,
        ),
    )
    sensor = arguments.sensor_out or arguments.target.with_name(
        f"{arguments.target.stem}-sensor.yaml"
    )
    done.recording.save(arguments.target)
    done.sensor.save(sensor)
    depth = done.recording.depth_mm
    print(
        f"{depth.shape[0]} rows x {depth.shape[1]} columns, "
        f"{100 * np.isnan(depth).mean():.2f} % missing, {done.repeated} repeated rows dropped"
    )
    print(f"wrote {arguments.target} and {sensor}")
    return 0
