"""The contract of an effect that acts on readings once they are measured, in the firmware."""

from abc import abstractmethod
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sensors.effects.base import Effect
from sensors.law import Delivery, Law, RngOf
from sensors.view.view import View

Floats = NDArray[np.float64]


class DeliveryEffect(Effect):
    """An effect on whole profiles of readings: last of all, wherever a file lists it.

    Its law holds the moments of what is delivered, point by point; a draw is a draw of what was
    measured, put through the firmware.
    """

    __slots__ = ()

    @abstractmethod
    def claimed(self, law: Law, view: View) -> Law:
        """Return the moments of the readings delivered, those of the measured ones being known."""

    @abstractmethod
    def deliver(
        self, depth_mm: Floats, reason: NDArray[np.uint8], rng_of: RngOf
    ) -> tuple[Floats, NDArray[np.uint8]]:
        """Return what is delivered of a scan's readings (n, m), mm, and why points are missing."""

    def smoothing(self) -> Floats | None:
        """Return the correlation that white noise has afterwards; None where it stays white."""
        return None

    def changed(self, law: Law, view: View) -> Law:
        """Claim the delivered moments; keep the measured law for drawing from."""
        delivery = Delivery(measured=law, deliver=self.deliver, smoothing=self.smoothing())
        return replace(self.claimed(law, view), delivery=delivery)
