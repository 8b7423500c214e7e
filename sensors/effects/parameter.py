"""One parameter of an effect: meaning, unit, bounds, owner."""

import dataclasses
from typing import Any, Literal

from quantity import Quantity, declared

Owner = Literal["instrument", "recording"]
Value = float | int | str | tuple[float, ...] | None


@dataclasses.dataclass(frozen=True, kw_only=True, slots=True)
class Parameter(Quantity):
    """Description of one field of an effect, beyond that of a `Quantity`.

    `typical` is a value to start from or to show; the field's default unless that is None.

    Attributes
    ----------
    null : float or None
        The value at which the effect vanishes (once all parameters with a null are at theirs).
    owner : "instrument" or "recording"
        Whether all recordings share the parameter, or each recording has a value. None in a
        per-recording parameter stands for a uniform draw from `prior`.
    linear : bool
        Whether the mean depth is linear in it.
    grid : tuple of float
        Coarse values of a search; empty where the parameter is linear or drawn.
    sheet : str
        Key of the datasheet that stands in where the value is None; "" without one.
    known : str
        Attribute of the view that replaces the per-recording parameter where it is not None.
    prior : (float, float) or None
        Range of the uniform prior of a per-recording parameter.
    choices : tuple of str
        Allowed values of a text parameter.
    fixed : bool
        Whether a fit holds the parameter constant: known or weakly identifiable.
    kind : "number", "integer", "list" or "choice"
    """

    null: float | None = None
    owner: Owner = "instrument"
    linear: bool = False
    grid: tuple[float, ...] = ()
    sheet: str = ""
    known: str = ""
    prior: tuple[float, float] | None = None
    choices: tuple[str, ...] = ()
    kind: Literal["number", "integer", "list", "choice"] = "number"
    fixed: bool = False

    @property
    def searched(self) -> bool:
        """Whether the parameter is free in a fit: a number that is not fixed."""
        return self.kind == "number" and not self.fixed

    def fits(self, value: object) -> bool:
        """Whether `value` is of this parameter's kind and within its bounds."""
        if self.kind == "choice":
            return isinstance(value, str) and value in self.choices
        if self.kind == "list":
            return isinstance(value, tuple) and all(self.holds(entry) for entry in value)
        if self.kind == "integer" and not isinstance(value, int):
            return False
        return self.holds(value)

    @property
    def bounds_text(self) -> str:
        """Bounds as a user reads them."""
        if self.kind == "choice":
            return " or ".join(self.choices)
        return self.allowed


def parameter(  # noqa: PLR0913 - a keyword for each attribute of a parameter
    meaning: str,
    *,
    unit: str = "",
    low: float = 0.0,
    high: float = 0.0,
    typical: Value = None,
    null: float | None = None,
    owner: Owner = "instrument",
    linear: bool = False,
    grid: tuple[float, ...] = (),
    sheet: str = "",
    known: str = "",
    prior: tuple[float, float] | None = None,
    choices: tuple[str, ...] = (),
    kind: Literal["number", "integer", "list", "choice"] = "number",
    fixed: bool = False,
    default: Value = None,
) -> Any:
    """Declare a field of an effect; see `Parameter`.

    The default is the typical value where none is given; None where the datasheet stands in or a
    recording draws it.
    """
    left_open = bool(sheet) or owner == "recording"
    described = Parameter(
        meaning=meaning,
        unit=unit,
        low=low,
        high=high,
        typical=typical,
        null=null,
        owner=owner,
        linear=linear,
        grid=grid,
        sheet=sheet,
        known=known,
        prior=(low, high) if prior is None and owner == "recording" else prior,
        choices=choices,
        kind="choice" if choices else kind,
        fixed=fixed,
        whole=kind == "integer",
    )
    if default is None and not left_open:
        default = typical
    return declared(described, default=default)
