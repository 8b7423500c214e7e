"""The page of sensor.yaml and surface.yaml: keys from the code, presets from their files."""

import dataclasses
import typing
from collections.abc import Iterator
from typing import Any

from quantity import quantities
from sensors.datasheet import Datasheet, preset_names
from sensors.surface.surface import Surface

HEAD = """\
# Sensor and surface

Made by the site's build from the code. A key without a default is required; `null` states that the
value is unknown.
"""
SHOWN = (
    "working_distance_mm", "z_range_mm", "x_fov_mm", "points_per_profile", "z_resolution_um",
    "repeatability_um", "profile_rate_hz",
)  # fmt: skip


def text() -> str:
    """Return the page."""
    lines = [HEAD, "## Keys of sensor.yaml", "", *keys(Datasheet), ""]
    lines += ["`effects` lists physics beyond the nominal model: see [effects](../effects.md).", ""]
    lines += ["## Preset sensors", "", *sensors(), ""]
    lines += ["Each preset's file names the datasheet of its values.", ""]
    lines += ["## Keys of surface.yaml", "", *keys(Surface), ""]
    lines += ["`flawforge roughness FILE` measures a surface and writes the file.", ""]
    lines += ["## Preset surfaces", "", *surfaces(), ""]
    return "\n".join(lines)


def keys(record: type[Any]) -> Iterator[str]:
    """Rows of a file's keys."""
    known = {quantity.name: quantity for quantity in quantities(record)}
    yield "| key | meaning | allowed | default |"
    yield "| --- | --- | --- | --- |"
    for field in dataclasses.fields(record):
        default = "required" if field.default is dataclasses.MISSING else stated(field.default)
        if field.name in known:
            number = known[field.name]
            yield f"| `{field.name}` | {number.meaning} | {number.allowed} | {default} |"
        elif typing.get_origin(field.type) is typing.Literal:
            choices = " or ".join(f"`{choice}`" for choice in typing.get_args(field.type))
            yield f"| `{field.name}` | {OTHERS[field.name]} | {choices} | {default} |"
        else:
            yield f"| `{field.name}` | {OTHERS[field.name]} | | {default} |"


OTHERS = {
    "name": "name of the sensor or surface",
    "columns": "an even fan of rays from the optical axis, or parallel rays at an even pitch",
    "camera_side": "side of the camera along the travel",
    "effects": "list of effects, each a mapping with `name` and parameters",
    "source": "where the figures come from",
    "calibration": "noise that was solved for these figures; written by flawforge",
    "measured": "autocorrelation and heights of a plate's noise; written by flawforge",
}


def stated(value: object) -> str:
    """Write a default as in YAML."""
    return f"`{'null' if value is None else list(value) if value == () else value}`"


def sensors() -> Iterator[str]:
    """Rows of the preset sensors."""
    yield "| sensor | " + " | ".join(f"`{key}`" for key in SHOWN) + " |"
    yield "| --- " * (len(SHOWN) + 1) + "|"
    for name in preset_names("presets"):
        sheet = Datasheet.load(name)
        yield f"| {name} | " + " | ".join(short(getattr(sheet, key)) for key in SHOWN) + " |"


def surfaces() -> Iterator[str]:
    """Rows of the preset surfaces."""
    shown = ("rpm_mm", "rvm_mm", "pc_per_mm", "pitch_x_mm", "pitch_y_mm")
    yield "| surface | " + " | ".join(f"`{key}`" for key in shown) + " | source |"
    yield "| --- " * (len(shown) + 2) + "|"
    for name in preset_names("surfaces"):
        surface = Surface.load(name)
        values = " | ".join(short(getattr(surface, key)) for key in shown)
        yield f"| `{name}` | {values} | {surface.source or ''} |"


def short(value: float | None) -> str:
    """Write a number."""
    return "" if value is None else f"{value:g}"
