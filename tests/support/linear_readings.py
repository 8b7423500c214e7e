"""Readings of a linear model with known components, as the evidence sees recordings."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from diagnosis.components.component import Component, components_of
from diagnosis.evidence.candidates import Candidate
from diagnosis.evidence.gram import Block, Gram
from diagnosis.evidence.seen import Seen
from diagnosis.settings import SETTINGS

Floats = NDArray[np.float64]
EFFECTS = ("line_bow", "form_error", "incidence_bias")
"""Effects whose components the readings have: any three whose forms are smooth."""
COUNT, WIDE = 4000, 4


@dataclass(frozen=True, kw_only=True, eq=False)
class LinearReadings:
    """Readings y = X b + noise of unit variance, four columns for each component.

    Attributes
    ----------
    columns : (N, M) whose components have a rms of 1 for coefficients of 1
    values : (N,)
    """

    components: tuple[Component, ...]
    columns: Floats
    values: Floats

    @classmethod
    def drawn(
        cls,
        sizes: Mapping[str, float],
        *,
        seed: int,
        noise_seed: int = 1,
        alike: bool = False,
        effects: Sequence[str] = EFFECTS,
    ) -> "LinearReadings":
        """Draw readings in which components have sizes (whitened rms); others have none.

        Parameters
        ----------
        alike : whether the second component's columns are those of the first
        effects : whose components the readings have
        """
        rng = np.random.default_rng(seed)
        known = {c.effect: c for c in reversed(components_of("mean"))}
        components = tuple(known[e] for e in effects)
        blocks = [rng.standard_normal((COUNT, WIDE)) for _ in components]
        if alike:
            blocks[1] = blocks[0] @ np.linalg.qr(rng.standard_normal((WIDE, WIDE)))[0]
        columns = np.hstack([b * np.sqrt(COUNT / np.square(b).sum()) for b in blocks])
        b = np.zeros(columns.shape[1])
        for k, effect in enumerate(effects):
            way = rng.standard_normal(WIDE)
            own = columns[:, WIDE * k : WIDE * (k + 1)]
            size = sizes.get(effect, 0.0)
            b[WIDE * k : WIDE * (k + 1)] = size * way / np.std(own @ way)
        noise = np.random.default_rng([seed, noise_seed]).standard_normal(COUNT)
        return cls(components=components, columns=columns, values=columns @ b + noise)

    @property
    def sizes(self) -> Floats:
        """Grid of sizes."""
        return SETTINGS.mean_sizes()

    @property
    def gram(self) -> Gram:
        """Their normal equations."""
        return Gram(
            blocks=tuple(
                Block(component=c, recording=None, columns=slice(WIDE * k, WIDE * (k + 1)))
                for k, c in enumerate(self.components)
            ),
            matrix=self.columns.T @ self.columns, right=self.columns.T @ self.values,
            readings=len(self.values),
        )  # fmt: skip

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """Return one candidate for each component, its columns as they are."""
        return tuple(
            Candidate(name=b.component.effect, effect=b.component.effect, component=b.component,
                      at=b.at)
            for b in self.gram.blocks
        )  # fmt: skip

    @property
    def seen(self) -> Seen:
        """The readings as the evidence sees them."""
        return Seen(
            bulk=self.gram, whole=self.gram, candidates=self.candidates, ranges={},
            turns={c.name: np.ones(1) for c in self.components}, components=self.components,
        )  # fmt: skip
