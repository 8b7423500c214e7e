"""Built-in parts: parametric, closed, in double precision, at life size."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any, Final, cast

from pipeline.parts.part import Part
from pipeline.parts.part_error import PartError
from quantity import Quantity, quantities

NAMES: Final[tuple[str, ...]] = ("bearing_cap", "car_door", "steel_plate", "welded_plate")
FACET_UM: Final = Quantity(
    meaning="distance of the facets from the true surface at most; the part's own where left out",
    unit="µm", low=1, high=1000,
)  # fmt: skip


def build(name: str, facet_um: float | None = None, **parameters: Any) -> Part:
    """Build a built-in part.

    Every part is centred in x and y on the origin, stands on z = 0 and shows its main visible
    face to +z.

    Parameters
    ----------
    name
        one of `NAMES`.
    facet_um
        Largest allowed distance between facets and the true surface, µm; each part's own
        default where None.
    **parameters
        Fields of the part's parameter class (`parameters_of`), e.g. ``length_mm=300``.

    Raises
    ------
    PartError
        For an unknown name or parameter, or a value out of its bounds.
    """
    source = f"builtin:{name}"
    cls = parameters_of(name)
    known = {size.name: size for size in quantities(cls)}
    for key in parameters:
        if key not in known:
            raise PartError(source, f"unknown parameter {key!r}", f"one of {', '.join(known)}")
    for key, value in parameters.items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise PartError(source, f"{key} = {value!r} is not a number", "give a number")
    if facet_um is not None and not FACET_UM.holds(facet_um):
        raise PartError(source, f"facet_um = {facet_um:g}", f"allowed: {FACET_UM.allowed}")
    chosen = cls(**{key: float(value) for key, value in parameters.items()})
    for key, size in known.items():
        value = getattr(chosen, key)
        if not size.holds(value):
            raise PartError(source, f"{key} = {value:g}", f"allowed: {size.allowed}")
    make = cast("Callable[[Any, float | None], Part]", import_module(f"{__name__}.{name}").make)
    return make(chosen, None if facet_um is None else float(facet_um))


def parameters_of(name: str) -> type[Any]:
    """Parameter class of a built-in: frozen, with default, unit and bounds of every field."""
    if name not in NAMES:
        raise PartError(f"builtin:{name}", "no such built-in part", f"one of {', '.join(NAMES)}")
    return cast("type[Any]", import_module(f"{__name__}.{name}").PARAMETERS)


def describe(name: str) -> tuple[Quantity, ...]:
    """Return what is declared of each parameter of a built-in: default, bounds, unit, meaning."""
    return quantities(parameters_of(name))
