"""Covariates of a reading, by name, with their frames."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sensors.view.camera import row_of_depth
from sensors.view.edges import edge_height_mm, edge_offset_mm
from sensors.view.view import View, ViewFunction

Floats = NDArray[np.float64]
Frame = Literal["sensor", "time", "travel", "part"]
Place = Literal["", "edges", "beside edges", "corners"]


@dataclass(frozen=True, kw_only=True, slots=True)
class Covariate:
    """One quantity known at each point from CAD, pose and clock.

    Attributes
    ----------
    name : key in `COVARIATES`
    words : what it is, for a report
    unit : of its values
    frame : what it follows: the sensor, the time, the travel or the part
    values : function of a view; broadcastable to (n, m), NaN where there is none
    needs : keys of the datasheet without which it isn't known
    place : where effects that follow it act; "" for anywhere. Those on "edges" act on depth edges
        alone. Those "beside edges" act everywhere, and beside edges more: how dark a facet is
        determines how much of the line must lie beside it to be read
    approximate : whether laws of the mean that follow it are no more than good approximations
    """

    name: str
    words: str
    unit: str
    frame: Frame
    values: ViewFunction
    needs: tuple[str, ...] = ()
    place: Place = ""
    approximate: bool = False


def _clock(view: View) -> Floats:
    start = 0.0 if view.start_time_s is None else view.start_time_s
    return (start + view.time_s)[:, None]


def _brightness(view: View) -> Floats:
    return np.full(view.shape, np.nan) if view.brightness is None else view.brightness


def _brightness_slope(view: View) -> Floats:
    if view.brightness is None or len(view.poses) < 2:
        return np.full(view.shape, np.nan)
    step = view.travel_step_mm.copy()
    step[step == 0.0] = np.nan
    with np.errstate(divide="ignore", invalid="ignore"):
        log = np.log(view.brightness)
        return np.asarray(np.gradient(log, axis=0) / step[:, None])


def _curvature_y(view: View) -> Floats:
    """Second derivative of depth along the travel, from neighbouring profiles."""
    curvature = np.full(view.shape, np.nan)
    if len(view.poses) > 2:
        step = view.travel_step_mm[1:-1, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            curvature[1:-1] = np.diff(view.depth_mm, n=2, axis=0) / np.square(step)
    return curvature


def hidden_from(view: View, camera_y_mm: float) -> Floats:
    """Return 1 where a camera at (0, camera_y_mm, 0) doesn't see the hit, 0 where it does, (n, m).

    NaN at missing readings.
    """
    return np.where(view.in_range, (~view.visible_from(camera_y_mm)).astype(np.float64), np.nan)


STEEPEST = 3.0
"""Change of depth, in units of what moves the surface, beyond which no wall is steeper.

On an upright wall a micrometre aside is a millimetre deeper, if the wall is there at all.
"""


def shift_x(view: View) -> Floats:
    """Return the change of depth (n, m) by a ray moved along the line, for walls up to `STEEPEST`.

    dz = dx s / (1 - s r): the ray's x changes with the depth, r its own slope.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        along = view.slope_x / (1.0 - view.slope_x * view.laser.slope_x)
    return np.clip(along, -STEEPEST, STEEPEST)


def shift_y(view: View) -> Floats:
    """Return the change of depth (n, m) by a ray moved along the travel, as `shift_x`."""
    return np.clip(view.slope_y, -STEEPEST, STEEPEST)


def raised(view: View) -> Floats:
    """Return the change of depth (n, m) by a surface raised along the part's thinnest side."""
    low, high = view.scene.vertices_mm.min(axis=0), view.scene.vertices_mm.max(axis=0)
    return raised_along(view, int(np.argmin(high - low)), most=STEEPEST)


def raised_along(view: View, axis: int, *, most: float, by: float = 1.0) -> Floats:
    """Return the change of depth (n, m) by a surface raised along an axis of the part.

    Parameters
    ----------
    most : change of depth, in units of what the surface is raised by, at the steepest walls
    by : how far it is raised
    """
    out = np.einsum("nk,nmk->nm", view.poses[:, axis, :3], view.normal)
    nearer = np.clip(out / np.maximum(view.cos_incidence, 1e-9), -most, most)
    return np.asarray(-by * nearer / np.hypot(1.0, view.laser.slope_x))


def _camera_row(view: View) -> Floats:
    rows = view.datasheet.require("camera_rows")
    return np.asarray(row_of_depth(view.depth_mm, view.datasheet, rows) % 1.0)


CAMERA = ("triangulation_angle_deg",)
ALL = (
    Covariate(
        name="depth",
        words="range from the sensor",
        unit="mm",
        frame="sensor",
        values=lambda v: v.depth_mm,
    ),
    Covariate(
        name="x",
        words="position along the laser line",
        unit="mm",
        frame="sensor",
        values=lambda v: v.off_axis_mm,
    ),
    Covariate(
        name="column",
        words="column of the profile",
        unit="",
        frame="sensor",
        values=lambda v: np.arange(v.shape[1], dtype=np.float64)[None, :],
    ),
    Covariate(
        name="slope_x",
        words="slope along the laser line",
        unit="",
        frame="sensor",
        values=lambda v: v.slope_x,
    ),
    Covariate(
        name="slope_y",
        words="slope along the travel",
        unit="",
        frame="sensor",
        values=lambda v: v.slope_y,
    ),
    Covariate(
        name="shift_x",
        words="slope along the laser line as its rays meet it",
        unit="",
        frame="sensor",
        values=shift_x,
    ),
    Covariate(
        name="shift_y",
        words="slope along the travel as rays meet it",
        unit="",
        frame="sensor",
        values=shift_y,
    ),
    Covariate(
        name="incidence",
        words="angle between laser and surface normal",
        unit="rad",
        frame="sensor",
        values=lambda v: v.incidence_rad,
    ),
    Covariate(
        name="half_vector",
        words="angle between surface normal and half vector",
        unit="rad",
        frame="sensor",
        values=lambda v: v.half_vector_rad,
        needs=CAMERA,
        place="beside edges",
    ),
    Covariate(
        name="hidden",
        words="occlusion of the camera by the part",
        unit="",
        frame="sensor",
        values=lambda v: hidden_from(v, v.datasheet.camera_offset_mm),
        needs=CAMERA,
        place="edges",
    ),
    Covariate(
        name="camera_row",
        words="fractional camera row",
        unit="",
        frame="sensor",
        values=_camera_row,
        needs=(*CAMERA, "camera_rows"),
    ),
    Covariate(
        name="curvature_y",
        words="curvature along the travel",
        unit="1/mm",
        frame="part",
        values=_curvature_y,
        place="edges",
        approximate=True,
    ),
    Covariate(
        name="edge_y",
        words="distance along the travel to the nearest depth edge",
        unit="mm",
        frame="sensor",
        values=edge_offset_mm,
        place="edges",
        approximate=True,
    ),
    Covariate(
        name="edge_height",
        words="depth step at the nearest depth edge",
        unit="mm",
        frame="part",
        values=edge_height_mm,
    ),
    Covariate(
        name="wall_distance",
        words="distance to the facing wall in the mirror direction",
        unit="mm",
        frame="part",
        values=lambda v: v.mirror.distance_mm,
        place="corners",
        approximate=True,
    ),
    Covariate(
        name="clock",
        words="time since the instrument's start",
        unit="s",
        frame="time",
        values=_clock,
    ),
    Covariate(
        name="time",
        words="time since the first profile",
        unit="s",
        frame="time",
        values=lambda v: v.time_s[:, None],
    ),
    Covariate(
        name="travel",
        words="position along the travel",
        unit="mm",
        frame="travel",
        values=lambda v: v.travel_mm[:, None],
    ),
    Covariate(
        name="part_x",
        words="x on the part",
        unit="mm",
        frame="part",
        values=lambda v: v.part_mm[..., 0],
    ),
    Covariate(
        name="part_y",
        words="y on the part",
        unit="mm",
        frame="part",
        values=lambda v: v.part_mm[..., 1],
    ),
    Covariate(
        name="part_z",
        words="z on the part",
        unit="mm",
        frame="part",
        values=lambda v: v.part_mm[..., 2],
    ),
    Covariate(
        name="raised",
        words="change of depth by a surface raised by 1 mm along the part's thinnest side",
        unit="",
        frame="part",
        values=raised,
    ),
    Covariate(
        name="brightness",
        words="brightness of the laser line",
        unit="",
        frame="part",
        values=_brightness,
    ),
    Covariate(
        name="brightness_slope",
        words="relative change of brightness along the travel",
        unit="1/mm",
        frame="part",
        values=_brightness_slope,
    ),
)
COVARIATES: dict[str, Covariate] = {c.name: c for c in ALL}
