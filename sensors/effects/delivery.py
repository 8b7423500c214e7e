"""The interface of an effect of the firmware, which acts on measured readings."""

from abc import abstractmethod
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sensors.effects.effect import Effect
from sensors.law import Delivery, Law, RngOf
from sensors.view.view import View

Floats = NDArray[np.float64]


class DeliveryEffect(Effect):
    """An effect on whole profiles of readings; it acts last, wherever a file lists it.

    The law holds the moments of the delivered readings, point by point. A draw is a draw of
    measured readings, processed by the firmware.
    """

    __slots__ = ()

    @abstractmethod
    def claimed(self, law: Law, view: View) -> Law:
        """Return the moments of the delivered readings from those of the measured ones."""

    @abstractmethod
    def deliver(
        self, depth_mm: Floats, reason: NDArray[np.uint8], rng_of: RngOf
    ) -> tuple[Floats, NDArray[np.uint8]]:
        """Return the delivered readings of a scan (n, m), mm, and the reasons of missing ones."""

    def smoothing(self) -> Floats | None:
        """Return the correlation of white noise after the filter; None where it stays white."""
        return None

    def changed(self, law: Law, view: View) -> Law:
        """State the delivered moments; keep the measured law for draws."""
        delivery = Delivery(measured=law, deliver=self.deliver, smoothing=self.smoothing())
        return replace(self.claimed(law, view), delivery=delivery)
