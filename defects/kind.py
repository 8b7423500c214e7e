"""What every kind of flaw is: a frozen set of bounded sizes that builds its cutter at a site."""

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar, Self

import numpy as np

from defects.seats import Seat, Skin
from defects.sizes import Fixed, LogUniform, Size, Uniform
from defects.solid import Cutter
from defects.surface import Site, Surface


def size(
    unit: str, low: float, high: float, typical: tuple[float, float], whole: bool = False
) -> Any:
    """Declare a size of a kind of flaw.

    Parameters
    ----------
    unit
        "mm", or "1" for a ratio or a number of things. A severity tier's scale acts on "mm".
    low, high
        Bounds; values outside are errors.
    typical
        The range that is drawn from where a recipe says nothing.
    whole
        Whether values are rounded to whole numbers.
    """
    return field(
        metadata={"unit": unit, "low": low, "high": high, "typical": typical, "whole": whole}
    )


@dataclass(frozen=True, kw_only=True, slots=True)
class Kind(ABC):
    """One flaw's sizes; a subclass adds fields made by `size` and builds the cutter.

    Raises
    ------
    ValueError
        When a size is outside its bounds; one line.
    """

    name: ClassVar[str]
    class_id: ClassVar[int]
    seat: ClassVar[Seat] = Skin()

    def __post_init__(self) -> None:
        for spec in fields(self):
            value, meta = getattr(self, spec.name), spec.metadata
            if not meta["low"] <= value <= meta["high"]:
                raise ValueError(
                    f"{self.name}: {spec.name} is {value}, allowed {meta['low']} to {meta['high']}"
                )

    @abstractmethod
    def cutter(
        self, surface: Surface, site: Site, rng: np.random.Generator, sagitta_mm: float = 0.001
    ) -> Cutter:
        """Build the solids that make this flaw.

        Parameters
        ----------
        surface
            The skin that it follows.
        site
            Where, and in which direction.
        rng
            For what the sizes leave open: waviness, outline, branches.
        sagitta_mm
            How far the facets may stand off the wanted smooth surface.

        Raises
        ------
        SiteError
            When it doesn't fit here.
        """

    @classmethod
    def typical(cls) -> dict[str, Size]:
        """Return the distributions used where a recipe says nothing."""
        found: dict[str, Size] = {}
        for spec in fields(cls):
            low, high = spec.metadata["typical"]
            if low == high:
                found[spec.name] = Fixed(value=low)
            elif spec.metadata["unit"] == "mm":
                found[spec.name] = LogUniform(low=low, high=high)
            else:
                found[spec.name] = Uniform(low=low, high=high)
        return found

    @classmethod
    def draw(
        cls,
        sizes: Mapping[str, Size],
        rng: np.random.Generator,
        scale: float = 1.0,
        unscaled: Collection[str] = (),
    ) -> Self:
        """Draw one flaw's sizes, field by field in their order.

        Parameters
        ----------
        sizes
            A distribution for each field.
        rng
            Source of randomness.
        scale
            Factor on sizes in mm, which stay within their bounds.
        unscaled
            Names of the sizes that `scale` leaves alone.
        """
        values: dict[str, float] = {}
        for spec in fields(cls):
            value, meta = sizes[spec.name].draw(rng), spec.metadata
            if meta["unit"] == "mm" and spec.name not in unscaled:
                value = min(max(value * scale, meta["low"]), meta["high"])
            values[spec.name] = float(round(value)) if meta["whole"] else value
        return cls(**values)
