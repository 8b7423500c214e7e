"""A sensor: its datasheet, the effects that its file lists, and the law of its readings."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

from sensors.datasheet import Datasheet
from sensors.effects import effects_of
from sensors.effects.base import MotionEffect
from sensors.effects.delivery import DeliveryEffect
from sensors.effects.effect import Effect
from sensors.law import Law, RngOf, geometric_law
from sensors.line.beam import Beam
from sensors.noise.speckle import Speckle
from sensors.surface.surface import Surface
from sensors.view.view import View


@dataclass(frozen=True, slots=True, eq=False)
class SensorModel:
    """A datasheet with its effects, parsed once.

    Attributes
    ----------
    datasheet : Datasheet
    effects : the effects that the sensor's file lists, in order
    beam : the laser's line as these effects state it

    Raises
    ------
    RecipeError
        For a wrong effect in the datasheet.
    """

    datasheet: Datasheet
    effects: tuple[Effect, ...] = field(init=False)
    beam: Beam = field(init=False)

    def __post_init__(self) -> None:
        effects = effects_of(self.datasheet)
        object.__setattr__(self, "effects", effects)
        object.__setattr__(self, "beam", beam_of(effects))

    @classmethod
    def load(cls, source: str | Path) -> Self:
        """Read a sensor's YAML file, or a preset by its name.

        Raises
        ------
        RecipeError
            Where there is no such file or preset, or the file isn't a sensor.
        """
        return cls(Datasheet.load(source))

    def scan(
        self, view: View, surface: Surface | Speckle | None, rng_of: RngOf | None = None
    ) -> tuple[View, Law]:
        """Return the view from where the sensor really is, and the law of its readings.

        Parameters
        ----------
        view : View
            The scan at its commanded poses, by this sensor.
        surface : Surface, Speckle or None
            Roughness, or the noise made of it; None without speckle.
        rng_of : function, optional
            Gives the generator from which an effect's recording parameters are drawn, by the
            stream's name "effect:<name>". Without it, those left open are integrated out.

        Raises
        ------
        RecipeError
            Where the datasheet leaves out what an effect needs.
        """
        if view.sensor is not self:
            raise ValueError("a view of another sensor")
        return scan_with(view, surface, self.effects, rng_of)

    def law(
        self, view: View, surface: Surface | Speckle | None, rng_of: RngOf | None = None
    ) -> Law:
        """Return the law of the sensor's readings; see `scan`."""
        return self.scan(view, surface, rng_of)[1]


def scan_with(
    view: View,
    surface: Surface | Speckle | None,
    effects: Sequence[Effect],
    rng_of: RngOf | None = None,
) -> tuple[View, Law]:
    """Return true view and law with `effects`: what moves the sensor, the others, the firmware.

    See `SensorModel.scan`.
    """
    true, others = as_moved(view, draw_effects(effects, rng_of))
    law = geometric_law(true, surface)
    for effect in others:
        law = effect.apply(law, true)
    return true, law


def draw_effects(effects: Sequence[Effect], rng_of: RngOf | None) -> tuple[Effect, ...]:
    """Draw the recording's open parameters of each effect from the stream of its name."""
    if rng_of is None:
        return tuple(effects)
    return tuple(
        effect.draw(rng_of(f"effect:{effect.name}")) if effect.undrawn() else effect
        for effect in effects
    )


def as_moved(view: View, effects: Sequence[Effect]) -> tuple[View, list[Effect]]:
    """Apply what moves the sensor, where it is known by how much; return the rest in order.

    What the firmware does comes last.
    """
    others: list[Effect] = []
    for effect in effects:
        if isinstance(effect, MotionEffect) and not effect.undrawn(view):
            if not effect.is_null:
                for key in effect.needs:
                    view.datasheet.require(key)
                view = effect.moved(view)
        else:
            others.append(effect)
    return view, sorted(others, key=lambda effect: isinstance(effect, DeliveryEffect))


def beam_of(effects: Sequence[Effect]) -> Beam:
    """Return the laser's line as the effects of a sensor's file state it."""
    beam = Beam()
    for effect in effects:
        beam = effect.stated_on(beam)
    return beam


def as_wide(listed: Sequence[Effect], found: Mapping[str, Effect]) -> list[Effect]:
    """Return the listed effects with the line as wide, against the file, as those found have it.

    A line that is wider for one effect is so for all of them.

    Parameters
    ----------
    listed : effects of a sensor's file
    found : effects to be used in place of those of their name
    """
    for effect in listed:
        other = found.get(effect.name)
        if not effect.line_width or other is None:
            continue
        was, now = getattr(effect, effect.line_width), getattr(other, effect.line_width)
        scaled = {e.name for e in listed if e.line_width} - set(found)
        beam_um = other.stated_on(Beam()).sd_um
        if beam_um:
            # the effect itself has what becomes of readings; which of them are lost it hasn't
            was, now = effect.stated_on(Beam()).sd_um or beam_of(listed).stated_um, beam_um
            scaled -= {e.name for e in listed if "mean" in e.channels}
        if was and now is not None:
            return [_wider(e, now / was) if e.name in scaled else e for e in listed]
    return list(listed)


def _wider(effect: Effect, factor: float) -> Effect:
    width = getattr(effect, effect.line_width)
    if not width or factor == 1.0:
        return effect
    bounds = effect.parameter(effect.line_width)
    width = min(max(width * factor, bounds.low), bounds.high)
    return effect.with_parameters({effect.line_width: width})
