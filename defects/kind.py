"""The interface of a kind of flaw: bounded sizes, and a cutter at a site."""

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from defects.carving.solid import Cutter
from defects.seats.seat import Seat, Skin
from defects.surface.surface import Site, Surface
from quantity import Quantity, quantities
from quantity.distribution import Distribution, Fixed, LogUniform, Uniform


@dataclass(frozen=True, kw_only=True, slots=True)
class Kind(ABC):
    """One flaw's sizes; a subclass adds fields made by `quantity` and builds the cutter.

    `typical` of a size is the default range of draws; a severity tier's scale acts on sizes in mm.

    Raises
    ------
    ValueError
        When a size is outside its bounds; one line.
    """

    name: ClassVar[str]
    class_id: ClassVar[int]
    seat: ClassVar[Seat] = Skin()

    def __post_init__(self) -> None:
        for size in self.sizes():
            value = getattr(self, size.name)
            if not size.holds(value):
                raise ValueError(f"{self.name}: {size.name} is {value}, allowed {size.allowed}")

    @classmethod
    def sizes(cls) -> tuple[Quantity, ...]:
        """Return the declaration of each size, in the order of the fields."""
        return quantities(cls)

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
    def typical(cls) -> dict[str, Distribution]:
        """Return the default distributions of the sizes."""
        found: dict[str, Distribution] = {}
        for size in cls.sizes():
            low, high = size.typical
            if low == high:
                found[size.name] = Fixed(value=low)
            elif size.unit == "mm":
                found[size.name] = LogUniform(low=low, high=high)
            else:
                found[size.name] = Uniform(low=low, high=high)
        return found

    @classmethod
    def scaled_by_tier(cls, size: Quantity) -> bool:
        """Whether a severity tier's scale acts on a size: on those in mm."""
        return size.unit == "mm"

    @property
    def source(self) -> str:
        """Name of the real flaw of its origin; empty for a drawn flaw."""
        return ""

    def parameters(self) -> dict[str, float]:
        """Return the sizes by name."""
        return {size.name: getattr(self, size.name) for size in self.sizes()}

    @classmethod
    def draw(
        cls,
        sizes: Mapping[str, Distribution],
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
            Factor on the sizes that `scaled_by_tier` names, which stay within their bounds.
        unscaled
            Names of the sizes that `scale` leaves alone.
        """
        values: dict[str, float] = {}
        for size in cls.sizes():
            value = sizes[size.name].draw(rng)
            if cls.scaled_by_tier(size) and size.name not in unscaled:
                value = size.clipped(value * scale)
            values[size.name] = float(round(value)) if size.whole else value
        return cls(**values)
