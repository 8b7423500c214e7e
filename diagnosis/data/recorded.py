"""Recordings with their part, sensor and rays: what a placement of one of them is looked at by."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from diagnosis.data.patch import Patch, cut
from diagnosis.fields import Field, Mask
from diagnosis.register.placement import Placement
from diagnosis.register.registration import register
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet
from sensors.recording import Recording


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Recorded:
    """The recordings under study.

    Attributes
    ----------
    laser : rays of each recording's columns, by its name
    lateral_mm : how far an edge may be off for no reason of physics
    held_out : for each recording (n, m), readings that must not be fitted
    """

    recordings: tuple[Recording, ...]
    scene: Scene
    datasheet: Datasheet
    laser: Mapping[str, Laser]
    lateral_mm: float
    held_out: tuple[Mask, ...]

    def rays(self, number: int) -> Laser:
        """Return the rays of a recording's columns."""
        return self.laser[self.recordings[number].name]

    def cut(self, number: int, placement: Placement) -> list[Patch]:
        """Look at a recording from a placement."""
        return cut(
            number, self.recordings[number], placement, self.scene, self.datasheet,
            self.rays(number), lateral_mm=self.lateral_mm, held_out=self.held_out[number],
        )  # fmt: skip

    def register(
        self, number: int, valid: Mask, offset_mm: Field, sd_mm: float, spread: Field
    ) -> Placement:
        """Register a recording of which a model expects an offset and a spread; see `register`."""
        return register(
            self.scene, self.recordings[number], self.rays(number), datasheet=self.datasheet,
            valid=valid, offset_mm=np.nan_to_num(offset_mm), sd_mm=sd_mm, spread=spread,
        )  # fmt: skip
