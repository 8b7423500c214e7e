"""A model of the recordings: effects with their parameters, curves beside them, noise level."""

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field, replace

from diagnosis.components.free_curve import Curve
from diagnosis.predict.expectation import Shares
from diagnosis.predict.prediction import effects_for
from sensors.effects.base import Effect

OwnParameters = Mapping[int, Mapping[str, Mapping[str, float]]]
"""Parameters that belong to a recording: by its number, by effect, by name."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Model:
    """Effects with the parameters that all recordings share, and each recording's own."""

    effects: tuple[Effect, ...] = ()
    own: OwnParameters = field(default_factory=dict)
    level: float = 1.0
    """Factor on the calibrated noise, where an effect changes what it was calibrated over."""
    shares: Shares | None = None
    """How much of what effects change counts; wholly where None."""
    curve: Curve = Curve()
    """What laws leave of their causes."""

    @property
    def key(self) -> Hashable:
        """What models that predict the same have in common."""
        own = tuple(
            (r, e, tuple(sorted(values.items())))
            for r, of in sorted(self.own.items())
            for e, values in sorted(of.items())
        )
        shares = None if self.shares is None else self.shares.key
        return self.effects, own, self.level, shares, self.curve

    def with_effect(
        self, effect: Effect, own: Mapping[int, Mapping[str, float]] | None = None
    ) -> "Model":
        """Add an effect, in place of one of its name."""
        kept = tuple(e for e in self.effects if e.name != effect.name)
        merged = {r: {k: v for k, v in e.items() if k != effect.name} for r, e in self.own.items()}
        for recording, values in (own or {}).items():
            merged.setdefault(recording, {})[effect.name] = values
        return replace(self, effects=(*kept, effect), own=merged)

    def without(self, *names: str) -> "Model":
        """Take effects out, with the curves beside their laws."""
        return replace(
            self,
            curve=self.curve.without(*names),
            effects=tuple(e for e in self.effects if e.name not in names),
            own={r: {k: v for k, v in e.items() if k not in names} for r, e in self.own.items()},
        )

    def of(self, recording: int) -> tuple[Effect, ...]:
        """Effects as they act on one recording."""
        laws = effects_for(self.effects, self.own.get(recording, {}))
        return laws if self.curve.is_null else (*laws, self.curve)

    def by_cause(self, recording: int) -> dict[str, tuple[Effect, ...]]:
        """Laws, and curves beside them or instead of them, by the cause's name."""
        out: dict[str, tuple[Effect, ...]] = {
            e.name: (e,) for e in effects_for(self.effects, self.own.get(recording, {}))
        }
        for name in dict.fromkeys(p.component.effect for p in self.curve.parts):
            out[name] = (*out.get(name, ()), self.curve.only(name))
        return out

    @property
    def is_nominal(self) -> bool:
        """Whether nothing is added to the nominal model."""
        return not self.effects and self.curve.is_null

    def refitting(self, name: str) -> "Model":
        """Take out an effect whose law is fitted anew: the curve beside it stays."""
        return replace(self.without(name), curve=self.curve)

    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return tuple(e.name for e in self.effects)
