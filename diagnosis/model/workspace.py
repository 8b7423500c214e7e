"""The recordings under study, with what every step asks of them: predictions and scores."""

from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np

from diagnosis.components.free_curve import Curve
from diagnosis.data.patch import WHOLE, Patch, thinned
from diagnosis.fields import Field, Mask
from diagnosis.model.log_density import (
    Whitened,
    innovations_at,
    log_density,
    placed,
    placements,
    whitened,
)
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.predict.edges import on_edges
from diagnosis.predict.expectation import EdgeShares, expect
from diagnosis.predict.prediction import Prediction, effects_for
from sensors.effects.base import Effect

OwnParameters = Mapping[int, Mapping[str, Mapping[str, float]]]
"""Parameters that belong to a recording: by its number, by effect, by name."""
T = TypeVar("T")


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Model:
    """Effects with the parameters that all recordings share, and each recording's own."""

    effects: tuple[Effect, ...] = ()
    own: OwnParameters = field(default_factory=dict)
    level: float = 1.0
    """Factor on the calibrated noise, where an effect changes what it was calibrated over."""
    shares: EdgeShares | None = None
    """How much of what effects change at depth edges counts; wholly where None."""
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
        shares = None if self.shares is None else self.shares.shares.tobytes()
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

    def without(self, name: str) -> "Model":
        """Take an effect out, with the curve beside its law."""
        return replace(
            self,
            curve=self.curve.without(name),
            effects=tuple(e for e in self.effects if e.name != name),
            own={r: {k: v for k, v in e.items() if k != name} for r, e in self.own.items()},
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


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Workspace:
    """Patches, the noise, and blocks of readings that count as independent.

    Attributes
    ----------
    patches : those to fit
    noise : calibrated noise
    block : (rows, columns) of a block
    """

    patches: tuple[Patch, ...]
    noise: NoiseModel
    block: tuple[int, int]

    @classmethod
    def build(cls, patches: Sequence[Patch], noise: NoiseModel) -> "Workspace":
        """Choose blocks several correlation lengths wide, some dozens at least."""
        y, x = noise.correlation_length_px()
        rows, columns = patches[0].shape
        block = (
            int(np.clip(6 * y, 6, max(rows // 6, 2))),
            int(np.clip(6 * x, 6, max(columns // 6, 2))),
        )
        block = (max(block[0], rows // 16, 1), max(block[1], columns // 16, 1))
        return cls(patches=tuple(patches), noise=noise, block=block)

    def thin(self, budget: int) -> "Workspace":
        """Return a workspace of strips with at most about `budget` readings, for searching."""
        total = sum(p.depth_mm.size for p in self.patches)
        if total <= budget:
            return self
        patches = thinned(self.patches, budget)
        if len(patches) == len(self.patches) and total <= WHOLE:
            # already strips: with fewer profiles a part's form was not detected (a real plate's)
            return self
        return replace(self, patches=tuple(patches))

    def predict(self, model: Model) -> list[Prediction]:
        """Predict every patch."""
        return [
            expect(
                p.view, model.of(p.recording), self.noise, p.edge, softness=p.softness,
                level=model.level, shares=model.shares,
            )
            for p in self.patches
        ]

    def levelled(
        self,
        model: Model,
        *,
        placements: Mapping[int, Field] | None = None,
        shaped: bool | None = None,
    ) -> Model:
        """Refit the noise's overall level where an effect shapes it over the scan.

        Parameters
        ----------
        placements : of each recording, where they are known well enough
        shaped : whether one does, where that isn't the model's own affair
        """
        model = replace(model, level=1.0)
        if shaped is None:
            shaped = any("variance" in e.channels for e in model.effects)
        if not shaped:
            return model
        predictions = self.predict(model)
        if placements is None:
            states = self.states(predictions)
            found = [s.innovations[m & s.used & ~p.edge] for p, s, m in self._with(states)]
        else:
            found = []
            for p, q, m in self._with(predictions):
                innovations, used = innovations_at(p, q, self.noise, placements[p.recording])
                found.append(innovations[m & used & ~p.edge])
        squares = np.concatenate(found) ** 2
        if not squares.size:
            return model
        level = 1.0
        for _ in range(3):
            # a clipped normal's mean square is 0.995
            level = float(np.sqrt(np.minimum(squares, 9 * level**2).mean() / 0.995))
        return replace(model, level=level)

    def _with(self, values: Sequence[T]) -> Iterator[tuple[Patch, T, Mask]]:
        return zip(self.patches, values, self.masks(), strict=True)

    def states(self, predictions: Sequence[Prediction]) -> list[Whitened]:
        """Whiten every patch's residual, at the placement that suits it best."""
        raw = [whitened(p, q, self.noise) for p, q in zip(self.patches, predictions, strict=True)]
        moved = placements(self.patches, raw, self.masks())
        return [placed(p, s, moved[p.recording]) for p, s in zip(self.patches, raw, strict=True)]

    def masks(self) -> list[Mask]:
        """Return the readings that may be fitted."""
        return [p.fit & p.counted for p in self.patches]

    def placements(self, model: Model, masks: Sequence[Mask] | None = None) -> dict[int, Field]:
        """Best placement of each recording under a model, by the readings that may be fitted.

        Parameters
        ----------
        masks : the readings to place by instead
        """
        predictions = self.predict(model)
        raw = [whitened(p, q, self.noise) for p, q in zip(self.patches, predictions, strict=True)]
        return placements(self.patches, raw, masks or self.masks())

    def masks_for(self, effect: Effect | type[Effect]) -> list[Mask]:
        """Return the readings on which an effect is fitted: bulk physics away from edges."""
        if on_edges(effect):
            return self.masks()
        return [m & ~p.edge for p, m in zip(self.patches, self.masks(), strict=True)]

    def log_densities(
        self, model: Model, *, placements: Mapping[int, Field] | None = None
    ) -> list[Field]:
        """Log density of each reading of each patch, the placement refitted unless given."""
        moved = self.placements(model) if placements is None else placements
        return [
            log_density(p, q, self.noise, moved[p.recording])
            for p, q in zip(self.patches, self.predict(model), strict=True)
        ]

    def block_scores(
        self, densities: Sequence[Field], masks: Sequence[Mask] | None = None
    ) -> Field:
        """Sum log densities over blocks, all patches in a row, (blocks,)."""
        sums = [
            block_sums(np.where(m, d, 0.0), self.block)
            for d, m in zip(densities, masks or self.masks(), strict=True)
        ]
        return np.concatenate(sums)

    def count(self, masks: Sequence[Mask] | None = None) -> int:
        """Count the readings."""
        return int(sum(m.sum() for m in (masks or self.masks())))


def block_sums(field: Field, block: tuple[int, int]) -> Field:
    """Sum over blocks of a grid, (blocks,)."""
    rows = np.add.reduceat(field, np.arange(0, field.shape[0], block[0]), axis=0)
    return np.asarray(np.add.reduceat(rows, np.arange(0, field.shape[1], block[1]), axis=1).ravel())


def bootstrap_interval(
    blocks: Field, rng: np.random.Generator, *, level: float = 0.95, draws: int = 400
) -> tuple[float, float]:
    """Interval of the sum of independent blocks."""
    picks = rng.integers(0, blocks.size, (draws, blocks.size))
    sums = blocks[picks].sum(axis=1)
    low, high = np.quantile(sums, [(1 - level) / 2, (1 + level) / 2])
    return float(low), float(high)
