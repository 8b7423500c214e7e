"""`flawforge import`: turn an instrument's file into recording.h5 and a sensor.yaml for it."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sensors.formats.conversion import Imported

EPILOG = """\
formats, by suffix:
  .csv .txt     a matrix (a profile in each row); columns x,z (names such as x_mm,z_um give the
                units); points x,y,z on a grid; a Dektak's export
  .npy .tif     an array or an image of heights, integer or float
  .ply .pcd     point clouds whose points stand in rows and columns along x and y
  .json         SICK height maps (heights, reflectance, encoder)
  .x3p .sur     topographies with their units inside
  .xlsx         a table, or a Mitutoyo SurfTest report

Readings stay on the instrument's own grid: nothing is resampled, averaged or filled. Heights
become depth = working distance - height. The part frame is the instrument's: x along the columns,
y along the rows, z up; the sensor looks down from the working distance above height 0. Place a
CAD part in that frame before you diagnose. A working distance or rate that no one states is
assumed, and said so. Rows that repeat the one before while the travel goes on are no measurements
and are dropped.

Beside the recording a sensor.yaml is written that fits it: what the file doesn't tell (angle,
line width, exposure ...) is null; put in what you know.

examples:
  flawforge import image_9.json --as strip.h5
  flawforge import scan.npy --as scan.h5 --unit um --pitch-x-mm 0.1 --pitch-y-mm 0.2
  flawforge import z.tif --as z.h5 --z-step-mm 0.002 --missing 0 --pitch-x-mm 0.1 --pitch-y-mm 0.1
  flawforge import p1.csv p2.csv p3.csv --as lines.h5 --pitch-y-mm 0.5     a profile in each file
  flawforge diagnose strip.h5 --part strip.stl --sensor strip-sensor.yaml --out diagnosis
"""
LENGTHS = ("pitch_x_mm", "pitch_y_mm", "working_distance_mm", "z_step_mm", "rate_hz")
BARE = (".csv", ".txt", ".npy", ".tif", ".tiff")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's words."""
    parser.epilog = EPILOG
    parser.add_argument(
        "files", type=Path, nargs="+", metavar="FILE", help="what the instrument wrote"
    )
    parser.add_argument(
        "--as", dest="target", type=Path, metavar="REC.h5", required=True, help="recording to write"
    )
    parser.add_argument(
        "--unit",
        help="unit of the readings (of x, y, z in point clouds): mm, um, nm, cm, m, in"
        " (default: the file's own, else mm)",
    )
    parser.add_argument(
        "--z-step-mm", type=float, metavar="MM", help="height of one count of an integer file"
    )
    parser.add_argument(
        "--missing", type=float, metavar="NUMBER", help="number that stands for a missing point"
    )
    parser.add_argument(
        "--pitch-x-mm", type=float, metavar="MM", help="distance of the columns, mm"
    )
    parser.add_argument("--pitch-y-mm", type=float, metavar="MM", help="distance of the rows, mm")
    sign = parser.add_mutually_exclusive_group()
    sign.add_argument(
        "--height", dest="depth", action="store_false", help="readings are heights (default)"
    )
    sign.add_argument(
        "--depth", dest="depth", action="store_true", help="readings are distances from the sensor"
    )
    parser.set_defaults(depth=False)
    parser.add_argument(
        "--working-distance-mm", type=float, metavar="MM", help="sensor above height 0, mm"
    )
    parser.add_argument("--rate-hz", type=float, metavar="HZ", help="profiles per second")
    parser.add_argument(
        "--travel",
        choices=("+y", "-y"),
        default="+y",
        help="axis along which the rows follow each other; -y for images with y pointing up",
    )
    parser.add_argument(
        "--keep-repeated", action="store_true", help="keep rows that repeat the one before"
    )
    parser.add_argument("--name", help="name of the recording (default: the file's)")
    parser.add_argument(
        "--sensor-out", type=Path, metavar="YAML", help="sensor to write (default: REC-sensor.yaml)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Import; say what was made."""
    from sensors.formats import read_height_map
    from sensors.formats.conversion import Setup, convert, stack
    from sensors.typed_yaml import RecipeError

    files, target = arguments.files, arguments.target
    _check(arguments)
    maps = [read_height_map(path, arguments.unit) for path in files]
    setup = Setup(
        name=arguments.name or files[0].stem,
        pitch_x_mm=arguments.pitch_x_mm,
        pitch_y_mm=arguments.pitch_y_mm,
        working_distance_mm=arguments.working_distance_mm,
        rate_hz=arguments.rate_hz,
        z_step_mm=arguments.z_step_mm,
        missing=arguments.missing,
        depth=arguments.depth,
        backwards=arguments.travel == "-y",
        keep_repeated=arguments.keep_repeated,
    )
    try:
        done = convert(stack(maps), setup)
    except RecipeError as error:
        raise RecipeError(str(error), where=files[0]) from None
    sensor = arguments.sensor_out or target.with_name(f"{target.stem}-sensor.yaml")
    for path, save in ((target, done.recording.save), (sensor, done.sensor.save)):
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            save(path)
        except OSError as error:
            reason = error.strerror or str(error)
            raise RecipeError(f"can't be written ({reason})", where=path) from None
    _report(done, arguments.keep_repeated)
    print(f"wrote {target} and {sensor}")
    return 0


def _check(arguments: argparse.Namespace) -> None:
    from sensors.typed_yaml import RecipeError

    for key in LENGTHS:
        value = getattr(arguments, key)
        if value is not None and not 0.0 < value < float("inf"):
            word = f"--{key.replace('_', '-')}"
            raise RecipeError(f"{word} isn't above 0", value=value, allowed="a number above 0")
    if arguments.target.suffix.lower() not in (".h5", ".hdf5"):
        raise RecipeError("--as isn't a .h5 file", value=str(arguments.target), allowed=".h5")
    if arguments.target.is_dir():
        raise RecipeError("is a folder; --as should name a file", where=arguments.target)
    bare = all(path.suffix.lower() in BARE for path in arguments.files)
    for key in ("z_step_mm", "missing"):
        if getattr(arguments, key) is not None and not bare:
            word = f"--{key.replace('_', '-')}"
            raise RecipeError(f"{word} is for bare numbers", allowed=", ".join(BARE))
    if arguments.z_step_mm is not None and arguments.unit is not None:
        raise RecipeError("--unit and --z-step-mm both tell the height of one count; give one")


def _report(done: "Imported", kept: bool) -> None:
    import numpy as np

    from sensors.recording import repeated_rows

    recording, sensor = done.recording, done.sensor
    depth, x_mm = recording.depth_mm, recording.x_mm
    assert x_mm is not None
    pitch_x = float(np.median(np.abs(np.diff(x_mm))))
    pitch = f"{pitch_x:.6g} mm"
    if len(depth) > 1:  # of the rows as they came, repeated ones included
        pitch = f"{pitch_x:.6g} × {sensor.travel_speed_mm_s / sensor.profile_rate_hz:.6g} mm"
    print(
        f"{recording.name}: {depth.shape[0]} profiles × {depth.shape[1]} points, pitch {pitch}, "
        f"{100 * float(np.isnan(depth).mean()):.2f} % missing"
        + (", with intensity" if recording.intensity is not None else "")
    )
    if kept:
        print(f"repeated rows kept: {int(repeated_rows(depth).sum())}")
    else:
        print(f"repeated rows dropped: {done.repeated}")
    print(
        f"depth {float(np.nanmin(depth)):.6g} to {float(np.nanmax(depth)):.6g} mm, resolution"
        f" {sensor.z_resolution_um:g} µm"
    )
    for words in done.assumed:
        print(f"assumed: {words}")
