"""`flawforge import`: turn an instrument's file into recording.h5 and a sensor.yaml for it."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sensors.formats.conversion import Imported

EPILOG = """\
formats, by suffix:
  .csv .txt .asc .xyz .dat
                a matrix (a profile in each row), with or without axes; columns x,z (names such as
                x_mm,z_um state the units); points x,y,z on a grid, or profiles with an x per
                reading; exports of Gocator, Gwyddion, Dektak
  .npy .tif .png
                an array or an image of heights, integer or float; the second page of a TIFF is
                brightness, three channels are x, y, z
  .ply .pcd     point clouds with points in rows and columns along x and y
  .json         SICK height maps (heights, reflectance, encoder)
  .x3p .sur .sdf .bcr
                topographies that state their units
  .xlsx         a table, or a Mitutoyo SurfTest report

Readings stay on the instrument's grid: the import resamples, averages and fills nothing. The
depth is the working distance minus the height. The part frame is the instrument's: x along the
columns, y along the rows, z up. The sensor looks down from the working distance above height 0.
Place a CAD part in this frame before a diagnosis. The output lists assumed values, such as a
working distance that neither file nor option states. Repeated rows are no measurements and are
dropped.

Units, pitches and marks for missing points come from the file where it states them. The output
lists them. Where the readings are ambiguous (one isolated number that repeats, heights that don't
match the width) the import stops, and the message names the option that resolves the ambiguity.

The import also writes a sensor.yaml for the recording. Values that the file does not state
(angle, line width, exposure ...) are null; add those that you know.

examples:
  flawforge import image_9.json --as strip.h5
  flawforge import scan.npy --as scan.h5 --unit um --pitch-x-mm 0.1 --pitch-y-mm 0.2
  flawforge import z.tif --as z.h5 --z-step-mm 0.002 --missing 0 --pitch-x-mm 0.1 --pitch-y-mm 0.1
  flawforge import z.npy --as z.h5 --pitch-x-mm 0.1 --pitch-y-mm 0.1 --missing -32768 --missing 0
  flawforge import scan.csv --as scan.h5 --poses robot.csv --picture scan.png
  flawforge import p1.csv p2.csv p3.csv --as lines.h5 --pitch-y-mm 0.5     a profile in each file
  flawforge diagnose strip.h5 --part strip.stl --sensor strip-sensor.yaml --out diagnosis
"""
POSITIVE = ("pitch_x_mm", "pitch_y_mm", "working_distance_mm", "z_step_mm", "rate_hz")
BARE = (".csv", ".txt", ".asc", ".xyz", ".dat", ".npy", ".tif", ".tiff", ".png")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's words."""
    parser.epilog = EPILOG
    parser.add_argument(
        "files", type=Path, nargs="+", metavar="FILE", help="file of the instrument"
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
        "--z-offset-mm",
        type=float,
        default=0.0,
        metavar="MM",
        help="added to every height, mm",
    )
    parser.add_argument(
        "--missing",
        type=float,
        action="append",
        default=[],
        metavar="NUMBER",
        help="number that marks a missing point, as in the file; may be repeated",
    )
    parser.add_argument(
        "--columns",
        metavar="x=NAME,z=NAME",
        help="names of a table's columns: x, y, z, intensity, time, encoder (others are ignored)",
    )
    parser.add_argument(
        "--pitch-x-mm", type=float, metavar="MM", help="distance of the columns, mm"
    )
    parser.add_argument("--pitch-y-mm", type=float, metavar="MM", help="distance of the rows, mm")
    sign = parser.add_mutually_exclusive_group()
    sign.add_argument(
        "--height",
        "--height-up",
        dest="depth",
        action="store_false",
        help="readings are heights, growing towards the sensor (default)",
    )
    sign.add_argument(
        "--depth", dest="depth", action="store_true", help="readings are distances from the sensor"
    )
    parser.set_defaults(depth=False)
    parser.add_argument(
        "--working-distance-mm", type=float, metavar="MM", help="sensor above height 0, mm"
    )
    parser.add_argument(
        "--optical-axis-x-mm",
        type=float,
        default=0.0,
        metavar="MM",
        help="x of the sensor's optical axis, the origin of effects along the line (default: 0)",
    )
    parser.add_argument("--rate-hz", type=float, metavar="HZ", help="profiles per second")
    parser.add_argument(
        "--travel",
        choices=("+y", "-y"),
        default="+y",
        help="direction of the rows; -y for images with y pointing up",
    )
    parser.add_argument("--flip-x", action="store_true", help="the columns run along -x")
    parser.add_argument(
        "--poses",
        type=Path,
        metavar="CSV",
        help="pose of each row, sensor to part: x,y,z,qw,qx,qy,qz or another convention",
    )
    parser.add_argument(
        "--pose-convention",
        choices=("quaternion", "matrix", "wpr", "abc", "rotvec"),
        help="how --poses states rotations (default: by its columns' names)",
    )
    parser.add_argument(
        "--rows",
        type=Path,
        metavar="CSV",
        help="position (y_mm), encoder count or time of each row",
    )
    parser.add_argument(
        "--start-time-s",
        type=float,
        metavar="S",
        help="start of the recording on a clock common to all recordings, s",
    )
    parser.add_argument(
        "--no-check",
        dest="checked",
        action="store_false",
        help="accept readings without a plausibility check",
    )
    parser.add_argument(
        "--picture", type=Path, metavar="PNG", help="draw the recording, for a check by eye"
    )
    parser.add_argument(
        "--keep-repeated", action="store_true", help="keep rows that repeat the previous one"
    )
    parser.add_argument("--name", help="name of the recording (default: the file's)")
    parser.add_argument(
        "--sensor-out", type=Path, metavar="YAML", help="sensor to write (default: REC-sensor.yaml)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Import and print a summary."""
    from files.errors import RecipeError
    from sensors.formats import read_height_map
    from sensors.formats.conversion import Setup, convert, stack
    from sensors.formats.motion import read_poses, read_rows

    files, target = arguments.files, arguments.target
    _check(arguments)
    roles = _roles(arguments.columns)
    maps = [read_height_map(path, arguments.unit, columns=roles) for path in files]
    poses = arguments.poses and read_poses(arguments.poses, arguments.pose_convention)
    setup = Setup(
        name=arguments.name or files[0].stem,
        pitch_x_mm=arguments.pitch_x_mm,
        pitch_y_mm=arguments.pitch_y_mm,
        working_distance_mm=arguments.working_distance_mm,
        optical_axis_x_mm=arguments.optical_axis_x_mm,
        rate_hz=arguments.rate_hz,
        z_step_mm=arguments.z_step_mm,
        z_offset_mm=arguments.z_offset_mm,
        missing=tuple(arguments.missing),
        flip_x=arguments.flip_x,
        start_time_s=arguments.start_time_s,
        poses=poses,
        rows=None if arguments.rows is None else read_rows(arguments.rows),
        checked=arguments.checked,
        unit_given=arguments.unit is not None or arguments.z_step_mm is not None,
        options=_options(arguments),
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
    if arguments.picture is not None:
        _draw(done, arguments.picture)
        print(f"drew {arguments.picture}")
    print(f"wrote {target} and {sensor}")
    return 0


def _roles(columns: str | None) -> dict[str, str]:
    """Read `x=NAME,z=NAME`: the role of each named column."""
    from files.errors import RecipeError

    roles: dict[str, str] = {}
    for pair in columns.split(",") if columns else []:
        role, equals, name = pair.partition("=")
        if not equals or role.strip() not in ("x", "y", "z", "intensity", "time", "encoder"):
            raise RecipeError(
                "--columns isn't a list of ROLE=NAME", value=pair,
                allowed="x, y, z, intensity, time, encoder",
            )  # fmt: skip
        roles[name.strip()] = role.strip()
    return roles


def _options(arguments: argparse.Namespace) -> str:
    """Return what was asked for as JSON, files by their names, to be kept in the recording."""
    import json

    left = ("run", "target", "sensor_out", "picture", "debug", "command")
    kept = {}
    for key, value in sorted(vars(arguments).items()):
        if key.startswith("_") or key in left or callable(value) or value in (None, [], False):
            continue
        if isinstance(value, list):
            value = [one.name if isinstance(one, Path) else one for one in value]
        kept[key] = value.name if isinstance(value, Path) else value
    return json.dumps(kept, ensure_ascii=False)


def _check(arguments: argparse.Namespace) -> None:
    from files.errors import RecipeError

    for key in POSITIVE:
        value = getattr(arguments, key)
        if value is not None and not 0.0 < value < float("inf"):
            word = f"--{key.replace('_', '-')}"
            raise RecipeError(f"{word} is not above 0", value=value, allowed="a number above 0")
    if arguments.target.suffix.lower() not in (".h5", ".hdf5"):
        raise RecipeError("--as isn't a .h5 file", value=str(arguments.target), allowed=".h5")
    if arguments.target.is_dir():
        raise RecipeError("is a folder; --as should name a file", where=arguments.target)
    bare = all(path.suffix.lower() in BARE for path in arguments.files)
    if arguments.z_step_mm is not None and not bare:
        raise RecipeError(
            "--z-step-mm requires a file of counts without a unit", allowed=", ".join(BARE)
        )
    from sensors.datasheet import MOST_AXIS_MM

    axis_mm = arguments.optical_axis_x_mm
    if not abs(axis_mm) <= MOST_AXIS_MM:
        raise RecipeError(
            "--optical-axis-x-mm isn't a place beside the sensor", value=axis_mm,
            allowed=f"{-MOST_AXIS_MM:g} to {MOST_AXIS_MM:g}",
        )  # fmt: skip
    for key in ("z_offset_mm", "start_time_s"):
        value = getattr(arguments, key)
        if value is not None and not abs(value) < float("inf"):
            raise RecipeError(f"--{key.replace('_', '-')} isn't a number", value=value)
    if arguments.pose_convention is not None and arguments.poses is None:
        raise RecipeError("--pose-convention requires --poses")
    if arguments.poses is not None and arguments.rows is not None:
        raise RecipeError("--poses and --rows both state the position of the rows; give one")
    if arguments.z_step_mm is not None and arguments.unit is not None:
        raise RecipeError("--unit and --z-step-mm both state the height of one count; give one")


def _report(done: "Imported", kept: bool) -> None:
    import numpy as np

    from sensors.recording import repeated_rows

    recording, sensor = done.recording, done.sensor
    depth, x_mm = recording.depth_mm, recording.x_mm
    if recording.ray_x_mm is not None and recording.ray_slope is not None:
        x_mm = recording.ray_x_mm + sensor.working_distance_mm * recording.ray_slope
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
    for words in done.decisions:
        print(f"read: {words}")
    for words in done.assumed:
        print(f"assumed: {words}")


def _draw(done: "Imported", path: Path) -> None:
    """Draw heights (and brightness) with their axes in mm, and one profile in the middle."""
    import numpy as np
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from files.errors import RecipeError
    from files.whole_file import whole

    recording = done.recording
    heights = done.sensor.working_distance_mm - recording.depth_mm
    x_mm = recording.x_mm
    if recording.ray_x_mm is not None and recording.ray_slope is not None:
        x_mm = recording.ray_x_mm + done.sensor.working_distance_mm * recording.ray_slope
    assert x_mm is not None
    way = np.linalg.norm(np.diff(recording.poses[:, :3, 3], axis=0), axis=1)
    y_mm = np.concatenate([[0.0], np.cumsum(way)])
    panels = 1 + (recording.intensity is not None)
    figure = Figure(figsize=(5.2 * panels, 6.4), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(2, panels, squeeze=False, height_ratios=[2.2, 1.0])
    images = [("height, mm", heights, "viridis")]
    if recording.intensity is not None:
        images.append(("brightness", recording.intensity, "gray"))
    extent = (x_mm[0], x_mm[-1], y_mm[-1], y_mm[0] if y_mm[-1] > 0 else -1.0)
    for axes, (title, image, colours) in zip(grid[0], images, strict=True):
        shown = axes.imshow(image, extent=extent, aspect="auto", cmap=colours)
        figure.colorbar(shown, ax=axes)
        axes.set(title=title, xlabel="x, mm", ylabel="way of the rows, mm")
    middle = len(heights) // 2
    for axes, (title, image, _) in zip(grid[1], images, strict=True):
        axes.plot(x_mm, image[middle], linewidth=0.8)
        axes.set(title=f"profile {middle}", xlabel="x, mm", ylabel=title)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole(path) as aside:
            figure.savefig(aside)
    except (OSError, ValueError) as error:
        raise RecipeError(f"can't be written ({error})", where=path) from None
