"""Parameters of effects of the line's width: across the line, along it, and out of focus."""

from typing import Any

from sensors.effects.parameter import parameter

GRID_UM = 5.0, 15.0, 30.0, 60.0, 120.0
"""Widths that a search starts from, µm."""


def line_sd() -> Any:
    """Declare the width across the line; the datasheet's where none is given."""
    return parameter(
        "standard deviation of the line across its width at the working distance",
        unit="µm",
        low=0.0,
        high=500.0,
        typical=30.0,
        null=0.0,
        grid=GRID_UM,
        sheet="line_width_um",
    )


def along(otherwise: str = "") -> Any:
    """Declare the footprint along the line, and the meaning of 0."""
    return parameter(
        f"standard deviation of the footprint along the line (lens and pixel){otherwise}",
        unit="µm",
        low=0.0,
        high=500.0,
        typical=0.0,
        fixed=True,
    )


def rayleigh() -> Any:
    """Declare the Rayleigh length of the line."""
    return parameter(
        "distance from focus at which the line is √2 wider; 0: no defocus",
        unit="mm",
        low=0.0,
        high=10000.0,
        typical=0.0,
        fixed=True,
    )
