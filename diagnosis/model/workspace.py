"""The recordings under study, with what every step asks of them: predictions and scores."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from diagnosis.data.patch import WHOLE, Patch, thinned
from diagnosis.fields import Field, Mask
from diagnosis.model.blocks import block_of, block_sums
from diagnosis.model.log_density import (
    Whitened,
    innovations_at,
    log_density,
    placed,
    placements,
    whitened,
)
from diagnosis.model.model import Model
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.predict.edges import reaches_edges
from diagnosis.predict.expectation import expect
from diagnosis.predict.prediction import Prediction
from diagnosis.settings import SETTINGS
from sensors.effects.base import Effect

T = TypeVar("T")


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
        """Return a workspace of patches, with blocks by the noise's correlation."""
        block = block_of(patches[0].shape, noise)
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
        return self._placed_by(self.predict(model), masks or self.masks())

    def _placed_by(
        self, predictions: Sequence[Prediction], masks: Sequence[Mask]
    ) -> dict[int, Field]:
        raw = [whitened(p, q, self.noise) for p, q in zip(self.patches, predictions, strict=True)]
        return placements(self.patches, raw, masks)

    def masks_for(self, effect: Effect | type[Effect]) -> list[Mask]:
        """Return the readings on which an effect is fitted: bulk physics away from edges."""
        if reaches_edges(effect):
            return self.masks()
        return [m & ~p.edge for p, m in zip(self.patches, self.masks(), strict=True)]

    def log_densities(
        self, model: Model, *, placements: Mapping[int, Field] | None = None
    ) -> list[Field]:
        """Log density of each reading of each patch, the placement refitted unless given."""
        return self._densities(self.predict(model), placements)

    def _densities(
        self, predictions: Sequence[Prediction], moved: Mapping[int, Field] | None = None
    ) -> list[Field]:
        if moved is None:
            moved = self._placed_by(predictions, self.masks())
        return [
            log_density(p, q, self.noise, moved[p.recording])
            for p, q in zip(self.patches, predictions, strict=True)
        ]

    def most_probable(self, model: Model) -> float:
        """Log density of the readings that may be fitted, with noise at edges as suits.

        No edge is placed to a fraction of the spot: what readings scatter by there beyond the noise
        is no merit of a law that adds noise or smears the edge. The noise there is as large as
        suits, and so is how far an edge may be off.
        """
        predictions = self.predict(self.levelled(model, shaped=True))
        masks = self.masks()
        moved = self._placed_by(predictions, masks)

        def density(noise: float, place: float) -> float:
            further = math.sqrt(place**2 - 1)
            wider = [
                replace(q, sd_mm=np.where(
                    p.edge, noise * np.hypot(q.sd_mm, further * p.softness[0]), q.sd_mm
                ))
                for p, q in zip(self.patches, predictions, strict=True)
            ]  # fmt: skip
            found = zip(self._densities(wider, moved), masks, strict=True)
            return float(sum(d[m].sum() for d, m in found))

        return max(
            density(noise, place)
            for noise in SETTINGS.physics.edge_noise for place in SETTINGS.physics.edge_places
        )  # fmt: skip

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
