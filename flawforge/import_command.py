"""`flawforge import`: an instrument's height map as recording.h5, on its own grid."""

import argparse
import sys
from pathlib import Path

UNITS_MM = {"mm": 1.0, "um": 1e-3, "m": 1000.0, "inch": 25.4}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = (
        "Turn a height map (CSV, NPY, TIFF, PLY or PCD grid, SICK AppSpace JSON) into "
        "recording.h5. Rows follow the travel, columns lie along the laser line; readings keep "
        "their grid. The part's frame becomes: x along the columns, y along the rows, z up."
    )
    parser.add_argument("file", help="the height map")
    parser.add_argument("--as", dest="out", required=True, metavar="recording.h5", help="what to write")
    parser.add_argument("--pitch-x", type=float, help="distance of columns, in mm (where the file doesn't say)")
    parser.add_argument("--pitch-y", type=float, help="distance of rows, in mm (where the file doesn't say)")
    parser.add_argument("--unit", choices=sorted(UNITS_MM), help="unit of the values (default: the file's, else mm)")
    parser.add_argument("--scale", type=float, default=1.0, help="factor on the values, for raw counts (default: 1)")
    parser.add_argument("--values", choices=("height", "depth"), default="height",
                        help="whether values grow upwards or away from the sensor (default: height)")  # fmt: skip
    parser.add_argument("--missing", type=float, help="value that stands for no return")
    parser.add_argument("--standoff", type=float,
                        help="height of the sensor's origin above z = 0, mm (default: fits the heights)")  # fmt: skip
    parser.add_argument("--rate", type=float, default=1000.0, help="profiles a second (default: 1000)")
    parser.add_argument("--keep-repeats", action="store_true",
                        help="keep profiles that repeat the one before (default: drop them, and say so)")  # fmt: skip
    parser.add_argument("--name", help="name of the recording (default: the file's stem)")
    parser.add_argument("--sensor", metavar="sensor.yaml", help="also write a sensor file that fits the grid")


def run(args: argparse.Namespace) -> int:
    """Read, place and write; 0 when done."""
    import numpy as np

    from sensors.datasheet import Datasheet
    from sensors.recording import Recording, repeated_rows
    from sensors.recording_formats import read_height_map
    from sensors.typed_yaml import RecipeError

    grid = read_height_map(args.file)
    unit = UNITS_MM[args.unit] if args.unit else (grid.unit_mm or 1.0)
    pitch_x = args.pitch_x or (None if grid.pitch_x is None else grid.pitch_x * unit)
    pitch_y = args.pitch_y or (None if grid.pitch_y is None else grid.pitch_y * unit)
    for name, value in (("--pitch-x", pitch_x), ("--pitch-y", pitch_y)):
        if value is None:
            raise RecipeError(f"the file doesn't say its pitch: give {name}", where=args.file)
        if not np.isfinite(value) or value == 0:
            raise RecipeError(f"{name} must be a length", where=args.file, value=value)
    assert pitch_x is not None
    assert pitch_y is not None
    values = grid.values * args.scale * unit
    if args.missing is not None:
        values = np.where(np.isclose(grid.values, args.missing), np.nan, values)
    n, m = values.shape
    x_mm = np.arange(m) * pitch_x + (
        (grid.origin_x * unit) if grid.origin_x is not None else -(m - 1) / 2 * pitch_x
    )
    known = values[np.isfinite(values)]
    if known.size == 0:
        raise RecipeError("no reading at all: every point is missing", where=args.file)
    spread = max(float(np.ptp(known)), 1e-3)
    height = values if args.values == "height" else -values
    top = float(np.nanmax(height))
    standoff = args.standoff
    if standoff is None:
        standoff = float(np.ceil(top + max(100.0, 2 * spread))) if args.values == "height" else 0.0
    depth = standoff - height
    poses = np.tile(np.eye(4), (n, 1, 1))
    poses[:, :3, :3] = np.diag([1.0, -1.0, -1.0])
    poses[:, 1, 3] = np.arange(n) * pitch_y
    poses[:, 2, 3] = standoff
    time = np.arange(n) / args.rate
    brightness = grid.intensity
    repeats = repeated_rows(depth)
    told = ""
    if repeats.any():
        verb = "kept" if args.keep_repeats else "dropped"
        told = f"; {int(repeats.sum())} profiles repeat the one before them and were {verb}"
        if not args.keep_repeats:
            depth, poses, time = depth[~repeats], poses[~repeats], time[~repeats]
            brightness = None if brightness is None else brightness[~repeats]
    recording = Recording(
        name=args.name or Path(args.file).stem, depth_mm=depth, poses=poses, time_s=time - time[0],
        intensity=brightness, x_mm=x_mm, comment=f"imported from {Path(args.file).name}{told}",
    )  # fmt: skip
    recording.save(args.out)
    if args.sensor:
        middle = float(np.nanmedian(depth))
        reach = float(np.nanmax(np.abs(depth - middle)))
        steps = np.unique(np.round(known, 9))
        step = float(np.min(np.diff(steps))) if steps.size > 1 else 0.0
        Datasheet(
            name=f"as imported: {recording.name}",
            working_distance_mm=middle,
            z_range_mm=min(2.2 * reach + 1.0, 1.99 * middle),
            x_fov_mm=float(abs(pitch_x) * (m - 1)),
            points_per_profile=m,
            z_resolution_um=float(1e3 * step) if step < 0.1 else 0.0,
            profile_rate_hz=args.rate,
            travel_speed_mm_s=float(abs(pitch_y) * args.rate),
            columns="even_x",
        ).save(args.sensor)
    missing = 1 - np.isfinite(recording.depth_mm).mean()
    print(
        f"{args.out}: {recording.depth_mm.shape[0]} profiles of {m} points, pitch {abs(pitch_x):.4g} x "
        f"{abs(pitch_y):.4g} mm, {100 * missing:.1f} % missing, heights {known.min():.3f} to "
        f"{known.max():.3f} mm{told}",
        file=sys.stdout,
    )
    return 0
