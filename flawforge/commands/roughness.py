"""`flawforge roughness`: measure a surface's roughness and write its surface.yaml."""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from sensors.datasheet import Datasheet
    from sensors.noise.noise_target import NoiseTarget
    from sensors.noise.speckle import Speckle
    from sensors.surface.roughness import Roughness
    from sensors.surface.surface import Surface
    from sensors.surface.topography import Topography

    Floats = NDArray[np.float64]

EPILOG = """\
Writes surface.yaml (figures, and the noise whose simulated scans have the same figures, heights
and spectra), roughness.csv (figures of each profile) and roughness.png (profile, histogram,
spectra). The sign of the readings is kept: a peak of depths lies farther from the sensor.
Repeated profiles are dropped.

`--speckle measured` stores the autocorrelation and heights of the plate's noise, in place of
solving Perlin noise: neighbouring profiles that share their speckle may be correlated negatively,
which Perlin noise can't be. Without a cut-off, waviness of the plate counts as noise.

For a surface.yaml, the command solves the noise that has the stated figures.

examples:
  flawforge roughness plate.h5 --region 0:200,100:900 --cutoff-mm 2.5 --out plate
  flawforge roughness heights.npy --unit um --pitch-x-mm 0.045 --pitch-y-mm 0.2
  flawforge roughness profile.csv              two columns, x_mm,z_um in the first line
  flawforge roughness plate.h5 --speckle measured --out plate
  flawforge roughness mysteel.yaml             rpm_mm, rvm_mm, pc_per_mm and a pitch suffice
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's words."""
    parser.epilog = EPILOG
    parser.add_argument(
        "file",
        type=Path,
        metavar="FILE",
        help="recording.h5, surface.yaml, or a file that `flawforge import` reads",
    )
    parser.add_argument(
        "--region",
        metavar="R0:R1,C0:C1",
        help="profiles and points to use, half-open; either end may be omitted",
    )
    parser.add_argument(
        "--cutoff-mm",
        type=float,
        metavar="MM",
        help="cut-off wavelength of the Gaussian filter (ISO 16610-21) that removes the waviness",
    )
    parser.add_argument(
        "--form",
        choices=("line", "plane", "none"),
        default="line",
        help="form that is fitted and subtracted before the filter (line: one per profile)",
    )
    parser.add_argument("--unit", help="unit of the readings (default: the file's own, else mm)")
    parser.add_argument("--pitch-x-mm", type=float, metavar="MM", help="distance of the points")
    parser.add_argument("--pitch-y-mm", type=float, metavar="MM", help="distance of the profiles")
    parser.add_argument(
        "--sensor",
        metavar="SENSOR",
        help="sensor.yaml or preset, for resolution and the pitch of a fan",
    )
    parser.add_argument("--name", help="name of the surface (default: the file's)")
    parser.add_argument(
        "--speckle",
        choices=("perlin", "measured"),
        default="perlin",
        help="noise of the surface.yaml: Perlin noise with the recording's figures (perlin), or a "
        "field with its autocorrelation (measured; default perlin)",
    )
    parser.add_argument("--no-noise", action="store_true", help="write figures and pictures only")
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="folder for the results (default: NAME-roughness)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Measure, solve, write, draw."""
    from files.errors import RecipeError

    for key in ("cutoff_mm", "pitch_x_mm", "pitch_y_mm"):
        value = getattr(arguments, key)
        if value is not None and not 0.0 < value < float("inf"):
            raise RecipeError(
                f"--{key.replace('_', '-')} is not a length", value=value, allowed="above 0"
            )
    if arguments.file.suffix.lower() in (".yaml", ".yml"):
        return _solve_for_figures(arguments)
    return _measure(arguments)


def _solve_for_figures(arguments: argparse.Namespace) -> int:
    from files.errors import RecipeError
    from sensors.surface.surface import Surface

    surface = Surface.load(arguments.file)
    if surface.measured is not None:
        raise RecipeError(
            "'measured' is the file's noise; none is solved for its figures", where=arguments.file,
            allowed="a surface.yaml without 'measured'",
        )  # fmt: skip
    resolution, repeatability = _uncertainty(arguments)
    ready = surface.ready(
        arguments.pitch_x_mm,
        arguments.pitch_y_mm,
        z_resolution_um=3.8 if resolution is None else resolution,
        repeatability_um=repeatability,
    )
    out = _folder(arguments)
    ready.save(out / "surface.yaml")
    assert ready.calibration is not None
    print(f"largest error of a figure: {100 * ready.calibration.worst_error:.1f} %")
    print(f"wrote {out / 'surface.yaml'}")
    return 0


def _measure(arguments: argparse.Namespace) -> int:
    import numpy as np

    from files.errors import RecipeError
    from flawforge.region import parse_ranges
    from sensors.datasheet import Datasheet
    from sensors.noise.autocorrelation import measured_field
    from sensors.noise.calibration import calibrate
    from sensors.noise.noise_target import measure, simulated_figures
    from sensors.surface.form import remove_form
    from sensors.surface.roughness import FIGURES, profile_roughness
    from sensors.surface.surface import MeasuredNoise, Surface
    from sensors.surface.topography import load_topography, resolution_of

    sensor = Datasheet.load(arguments.sensor) if arguments.sensor else None
    scan = load_topography(
        arguments.file,
        unit=arguments.unit,
        pitch_x_mm=arguments.pitch_x_mm,
        pitch_y_mm=arguments.pitch_y_mm,
        sensor=sensor,
    )
    readings = scan.readings_mm[parse_ranges(arguments.region, scan.readings_mm.shape)]
    resolution_um, repeatability_um = _uncertainty(arguments)
    if resolution_um is None:
        resolution_um = float(f"{1000.0 * resolution_of(readings):.4g}")
    gain = _listed_gain(scan, sensor)
    readings = readings / gain
    try:
        wanted = measure(
            readings,
            scan.pitch_x_mm,
            scan.pitch_y_mm,
            # what the tilt makes louder isn't the sensor's own uncertainty
            resolution_mm=resolution_um / 1000.0 / gain,
            repeatability_mm=repeatability_um / 1000.0 / gain,
            cutoff_mm=arguments.cutoff_mm,
            form=arguments.form,
        )
        flat = remove_form(readings, scan.pitch_x_mm, arguments.cutoff_mm, arguments.form)
    except ValueError as error:
        raise RecipeError(str(error), where=arguments.file) from None
    figures = wanted.figures()
    surface = Surface(
        name=arguments.name or scan.name,
        ra_mm=figures["ra_mm"],
        rq_mm=figures["rq_mm"],
        rp_mm=figures["rp_mm"],
        rv_mm=figures["rv_mm"],
        rpm_mm=figures["rpm_mm"],
        rvm_mm=figures["rvm_mm"],
        pc_per_mm=figures["pc_per_mm"],
        pitch_x_mm=scan.pitch_x_mm,
        pitch_y_mm=scan.pitch_y_mm,
        points_per_profile=wanted.points,
        profiles=wanted.profiles,
        source=f"measured on {arguments.file.name}"
        + (f", region {arguments.region}" if arguments.region else "")
        + (f", cut-off {arguments.cutoff_mm:g} mm" if arguments.cutoff_mm else ""),
    )
    field: Speckle | None = None
    reached = None
    if arguments.speckle == "measured" and not arguments.no_noise:
        found = measured_field(
            flat, scan.pitch_x_mm, scan.pitch_y_mm, resolution_mm=wanted.resolution_mm,
            repeatability_mm=wanted.repeatability_mm,
        )  # fmt: skip
        surface = replace(surface, measured=MeasuredNoise.of(found))
        field, reached = found, simulated_figures(found, wanted, readings - flat)
    elif not arguments.no_noise:
        solution = calibrate(wanted)
        field, reached = solution.field, solution.reached
        surface = surface.with_solution(
            solution, resolution_um, repeatability_um, arguments.cutoff_mm
        )
    out = _folder(arguments)
    surface.save(out / "surface.yaml")
    each = profile_roughness(flat, scan.pitch_x_mm)
    header = ",".join(FIGURES)
    np.savetxt(out / "roughness.csv", each, "%.7g", delimiter=",", header=header, comments="")
    dropped = f", {scan.repeated} repeated ones dropped" if scan.repeated else ""
    print(
        f"{wanted.profiles} profiles × {wanted.points} points{dropped}, "
        f"pitch {scan.pitch_x_mm:g} × {scan.pitch_y_mm:g} mm, resolution {resolution_um:g} µm"
    )
    if gain != 1.0:
        print(f"tilt: the sensor's file lists {gain:.3f} times the noise; divided by that")
    _print_table(wanted, reached)
    _draw(surface, wanted, field, readings, flat, out / "roughness.png")
    print(f"wrote {out / 'surface.yaml'}, roughness.csv, roughness.png")
    return 0


def _uncertainty(arguments: argparse.Namespace) -> tuple[float | None, float]:
    from sensors.datasheet import Datasheet

    if not arguments.sensor:
        return None, 0.0
    sensor = Datasheet.load(arguments.sensor)
    return sensor.z_resolution_um, sensor.repeatability_um or 0.0


def _listed_gain(scan: "Topography", sensor: "Datasheet | None") -> float:
    """How much louder than square to the laser a sensor's file has the noise of a tilted plate."""
    from sensors.effects.incidence_noise import IncidenceNoise
    from sensors.model import SensorModel

    if sensor is None:
        return 1.0
    cosine = (1.0 + scan.slope_x**2 + scan.slope_y**2) ** -0.5
    gain = 1.0
    for effect in SensorModel(sensor).effects:
        if isinstance(effect, IncidenceNoise):
            gain *= float(effect.gain(cosine, scan.slope_y))
    return round(gain, 3)


def _folder(arguments: argparse.Namespace) -> Path:
    out: Path = arguments.out or Path(f"{arguments.file.stem}-roughness")
    out.mkdir(parents=True, exist_ok=True)
    return out


def _print_table(wanted: "NoiseTarget", reached: "Roughness | None") -> None:
    figures = wanted.figures()
    header = f"{'figure':<12}{'measured':>12}"
    print(header + (f"{'simulated':>12}{'error %':>10}" if reached else ""))
    for name, value in figures.items():
        line = f"{name:<12}{value:>12.5g}"
        if reached is not None:
            found = getattr(reached, name)
            line += f"{found:>12.5g}{100 * (found / value - 1):>10.1f}"
        print(line)


def _draw(
    surface: "Surface", wanted: "NoiseTarget", field: "Speckle | None", readings: "Floats",
    flat: "Floats", path: Path,
) -> None:  # fmt: skip
    import numpy as np

    from flawforge.roughness_picture import draw
    from sensors.noise.noise_target import simulate
    from sensors.surface.form import remove_form

    simulated = None
    if field is not None:
        rngs = np.random.default_rng([7, 0]), np.random.default_rng([7, 1])
        # with the form of the recording, on which rounding depends
        made = simulate(field, wanted, *rngs, depth_mm=readings - flat)
        simulated = remove_form(made, wanted.pitch_x_mm, wanted.cutoff_mm)
    draw(flat, simulated, wanted, surface.name, path)
