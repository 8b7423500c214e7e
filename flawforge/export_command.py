"""`flawforge export`: turn scans into recordings, point clouds or images."""

import argparse
from pathlib import Path

EPILOG = """\
recording: recording.h5 files, as an instrument would deliver them, ready for flawforge diagnose
ply:       point clouds in the part frame, labelled
png:       depth (16 bit) and masks

examples:
  flawforge export out/quickstart --to recording --out recordings
  flawforge export out/quickstart --to ply --scan car_door-0001-0000
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's words."""
    parser.epilog = EPILOG
    parser.add_argument("dataset", type=Path, metavar="DIR", help="folder of the dataset")
    parser.add_argument("--to", choices=("recording", "ply", "png"), required=True)
    parser.add_argument(
        "--scan",
        action="append",
        metavar="ID",
        help="which scan, may be given several times (default: all)",
    )
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="folder to write (default: DIR/export-FORMAT)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Export; say what was written."""
    from pipeline.dataset.export import export

    out = arguments.out or arguments.dataset / f"export-{arguments.to}"
    written = export(arguments.dataset, out, to=arguments.to, scans=arguments.scan)
    print(f"{len(written)} file{'' if len(written) == 1 else 's'} in {out}")
    return 0
