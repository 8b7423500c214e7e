"""`flawforge diagnose`: compare recordings with their simulation and find missing effects."""

import argparse
import sys
import time
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = (
        "Compare recordings with their simulation: locate differences, name the physical effects "
        "that the simulation lacks, and write the sensor's file with them."
    )
    parser.epilog = """\
Recordings in several poses separate effects that one recording confounds. The last recording (or
those of --holdout) is held out: no effect is fitted to it. Read DIR/report.html first. A recipe
with DIR/sensor.yaml simulates the effects found.

example:
  flawforge diagnose a.h5 b.h5 c.h5 --part part.stl --sensor sensor.yaml \\
      --reference plate.h5 --out diagnosis
"""
    parser.add_argument("recordings", nargs="+", metavar="REC.h5", help="recordings to explain")
    parser.add_argument(
        "--part", required=True, help="the part's mesh (STL, OBJ, PLY or 3MF), closed"
    )
    parser.add_argument(
        "--part-unit", default="mm", choices=("mm", "cm", "m", "inch", "um"),
        help="unit of the mesh's coordinates (default: mm)",
    )  # fmt: skip
    parser.add_argument("--sensor", required=True, help="the sensor's YAML file, or a preset")
    parser.add_argument("--surface", help="the surface's YAML file, or a preset: nominal roughness")
    parser.add_argument(
        "--reference", nargs="+", default=[], metavar="PLATE.h5",
        help="scans of a flat plate by the same instrument, to calibrate its noise",
    )  # fmt: skip
    parser.add_argument(
        "--holdout", nargs="+", default=[], metavar="REC.h5",
        help="held-out recordings (default: the last one; of a single recording, blocks)",
    )  # fmt: skip
    parser.add_argument(
        "--baseline", nargs="+", default=[], metavar="REC.h5",
        help="recordings of the part when the instrument was known to be good, from acceptance: "
        "then the question is what has changed since",
    )  # fmt: skip
    parser.add_argument("--out", required=True, help="folder for diagnosis.json, report.html, ...")
    parser.add_argument(
        "--seed",
        type=int,
        default=0,
        help="seed of the bootstrap intervals of the held-out scores; nothing else depends on it "
        "(default: 0)",
    )
    parser.add_argument("--quiet", action="store_true", help="no progress on stderr")


def run(args: argparse.Namespace) -> int:
    """Diagnose and write the results; 0 whatever the verdict."""
    import flawforge

    began = time.monotonic()

    def progress(text: str) -> None:
        if not args.quiet:
            print(f"[{time.monotonic() - began:5.1f} s] {text}", file=sys.stderr, flush=True)

    result = flawforge.diagnose(
        args.recordings,
        args.part,
        args.sensor,
        out=args.out,
        part_unit=args.part_unit,
        surface=args.surface,
        references=args.reference,
        holdout=args.holdout,
        baselines=args.baseline,
        seed=args.seed,
        progress=progress,
    )
    names = ", ".join(f"{e.name} ({e.probability:.0%})" for e in result.effects) or "none"
    print(f"{result.verdict}; effects: {names}; see {Path(args.out) / 'report.html'}")
    return 0
