"""A first recipe for a part; comments mark each guess."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pipeline.json_schema import MODELINE
from pipeline.parts.mesh.meshfile import read_mesh
from pipeline.parts.part import UNITS_MM, Part, load_part
from sensors.datasheet import Datasheet, preset_names

Floats = NDArray[np.float64]

LEAST_MM, MOST_MM = 10.0, 3000.0  # longest sides between which inspected parts usually lie
GUESSES: Final = ("mm", "inch", "m", "cm", "um")  # tried in this order
LARGEST_DENT: Final = 0.25  # of the part's narrower side
USUAL_ANGLE_DEG: Final = 30.0  # where the maker doesn't state the triangulation angle
FACING: Final = 0.7  # cosine from which a facet is looked at, 45°
MOST_POINTS: Final = 1024
LEAST_WIDTH_MM: Final = 0.05  # of a scratch by default, see defects/kinds/scratch.py
DIRECTIONS: Final = ((0, 0, -1), (0, 0, 1), (0, -1, 0), (0, 1, 0), (-1, 0, 0), (1, 0, 0))


@dataclass(frozen=True, kw_only=True, slots=True)
class Setup:
    """Look direction and travel over a part.

    Attributes
    ----------
    look, travel : (3,) ints
        Directions, part frame.
    width_mm, length_mm, height_mm : float
        The part's size across the travel, along it and along the look.
    """

    look: tuple[int, int, int]
    travel: tuple[int, int, int]
    width_mm: float
    length_mm: float
    height_mm: float


def guess_unit(path: Path) -> str:
    """Return the unit that gives the longest side a plausible length, mm first."""
    vertices, _, own = read_mesh(str(path))
    if own is not None:
        return own
    longest = float(np.ptp(vertices, axis=0).max())
    fitting = [u for u in GUESSES if LEAST_MM <= longest * UNITS_MM[u] <= MOST_MM]
    return fitting[0] if fitting else "mm"


def set_up(part: Part) -> Setup:
    """Look along the axis that most of the surface faces; travel along the longer side."""
    corners = part.vertices_mm[part.faces]
    crossed = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    area = np.linalg.norm(crossed, axis=1)
    cosine = -crossed @ np.array(DIRECTIONS, dtype=float).T / np.maximum(area, 1e-300)[:, None]
    faced = (area[:, None] * (cosine > FACING)).sum(axis=0)
    # of directions that see as much, the first: from above
    look = DIRECTIONS[int(np.argmax(np.round(faced / area.sum(), 3)))]
    size = np.ptp(part.vertices_mm, axis=0)
    along = int(np.argmax(np.abs(look)))
    across = [axis for axis in range(3) if axis != along]
    longer = max(across, key=lambda axis: size[axis])
    (shorter,) = (axis for axis in across if axis != longer)
    travel = tuple(int(axis == longer) for axis in range(3))
    return Setup(
        look=look, travel=(travel[0], travel[1], travel[2]), width_mm=float(size[shorter]),
        length_mm=float(size[longer]), height_mm=float(size[along]),
    )  # fmt: skip


def choose_sensor(setup: Setup) -> tuple[str, Datasheet, bool]:
    """Return the preset with the shortest line that covers the part, and whether it does."""
    sheets = {name: Datasheet.load(name) for name in preset_names("presets")}
    fits = {
        name: sheet
        for name, sheet in sheets.items()
        if sheet.x_fov_mm >= setup.width_mm and sheet.z_range_mm >= setup.height_mm
    }
    if fits:
        name = min(fits, key=lambda one: (fits[one].x_fov_mm, one))
        return name, fits[name], True
    deep = {n: s for n, s in sheets.items() if s.z_range_mm >= setup.height_mm} or sheets
    name = max(deep, key=lambda one: (deep[one].x_fov_mm, one))
    return name, deep[name], False


def draft(path: Path, *, where: str, unit: str | None, thicken_mm: float | None) -> str:
    """Write a recipe for a part.

    Parameters
    ----------
    path
        The mesh.
    where
        The part's path as the recipe is to name it.
    unit
        Of the mesh; guessed from its size where None.
    thicken_mm
        As in a recipe's `parts`.

    Raises
    ------
    PartError
        Where the mesh can't be used.
    """
    chosen = unit or guess_unit(path)
    part = load_part(path, unit=chosen, thicken_mm=thicken_mm)
    setup = set_up(part)
    sensor, sheet, covers = choose_sensor(setup)
    size = " x ".join(f"{_mm(side)}" for side in np.ptp(part.vertices_mm, axis=0))
    dent = min(20.0, LARGEST_DENT * min(setup.width_mm, setup.length_mm))
    points = min(MOST_POINTS, sheet.points_per_profile)
    pitch = max(sheet.x_fov_mm / points, LEAST_WIDTH_MM)
    others = ", ".join(name for name in preset_names("presets") if name != sensor)
    said = "given" if unit else "guessed from the size; check it"
    fit = "covers" if covers else "is the longest of a preset, yet does not cover"
    angle = (
        f"triangulation_angle_deg: {USUAL_ANGLE_DEG:g}    # typical: the maker states none\n"
        if sheet.triangulation_angle_deg is None
        else ""
    )
    thicken = f"    thicken_mm: {thicken_mm:g}\n" if thicken_mm is not None else ""
    name = "".join(c if c.isascii() and c.isalnum() else "_" for c in path.stem).strip("_")
    return f"""\
{MODELINE}
# Every key: docs/recipe.md. The schema of the first line: flawforge schema --out FILE.
name: {name[:60] or "part"}
seed: 1                        # same recipe, same seed, same bytes
sensor: {sensor}
# Its line of {sheet.x_fov_mm:g} mm {fit} the part's width of {_mm(setup.width_mm)} mm. Others:
# {others}; or a sensor.yaml of yours.
{angle}surface: car_door              # roughness: a preset, or a surface.yaml of yours
profiles: 400                  # of every scan
points: {points}                   # of every profile
specimens: 8                   # each with flaws of its own
scans: 2                       # of each specimen, each on a path of its own
good_specimens: 2              # without flaws, for detectors that learn what is normal
splits: {{train: 0.5, val: 0.25, test: 0.25}}
split_by: specimen             # no specimen is in two splits

parts:
  - path: {json.dumps(where, ensure_ascii=False)}
    unit: {chosen:<6}               # {said}: the part is {size} mm
{thicken}
flaws:                         # a number, or sizes, for each kind; docs/flaws.md shows the kinds
  min_distance_mm: {_mm(max(0.5, dent / 10))}
  dent:
    number: {{choice: [1, 2]}}
    length_mm: {{log_uniform: [{_mm(dent / 4)}, {_mm(dent)}]}}     # up to a quarter of the part
    depth_mm: {{log_uniform: [{_mm(dent / 100)}, {_mm(dent / 25)}]}}
  scratch:                     # wide enough for points {_mm(pitch)} mm apart
    number: {{choice: [1, 2]}}
    width_mm: {{log_uniform: [{_mm(pitch)}, {_mm(3 * pitch)}]}}
    depth_mm: {{log_uniform: [{_mm(pitch / 3)}, {_mm(pitch)}]}}
    length_mm: {{uniform: [{_mm(dent / 2)}, {_mm(dent * 1.5)}]}}
  pit:
    number: {{choice: [1, 2]}}
    diameter_mm: {{log_uniform: [{_mm(3 * pitch)}, {_mm(10 * pitch)}]}}

motion:
  look: {list(setup.look)}            # most of the surface faces this way
  travel: {list(setup.travel)}           # along the longer side
  length_mm: {{uniform: [{_mm(0.5 * setup.length_mm)}, {_mm(0.9 * setup.length_mm)}]}}
  yaw_deg: {{uniform: [-10, 10]}}
  roll_deg: {{uniform: [-3, 3]}}
  pitch_deg: {{uniform: [-3, 3]}}
  aim_at_flaws: 0.8            # share of the scans that look at a flaw
"""


def _mm(value: float) -> str:
    """Write a length with three digits, without exponent."""
    return str(np.format_float_positional(value, precision=3, fractional=False, trim="-"))
