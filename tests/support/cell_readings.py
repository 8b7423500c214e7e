"""Readings of noise or losses that follow one covariate, in cells, as a channel has them."""

from typing import Literal

import numpy as np

from diagnosis.components.component import Component, components_of
from diagnosis.evidence.glm import Events, Responses, Squares
from diagnosis.evidence.noise_and_loss_channels import (
    Channel,
    RateCandidate,
    RateVariant,
    level_sd_of,
)

CELLS, COUNT = 8, 40_000
USUAL = 0.1
"""Share of readings that are lost."""
U = np.linspace(-1.0, 1.0, CELLS)
LINEAR = U / np.sqrt(np.mean(U**2))


def component(channel: str, effect: str) -> Component:
    return next(c for c in components_of(channel) if c.effect == effect)


def channel_with(
    change: float, kind: Literal["scale", "rate"], effect: str, columns: np.ndarray, seed: int, *,
    count: int = COUNT,
) -> Channel:  # fmt: skip
    """Readings in eight cells over a covariate, off edges; the predictor changes by columns."""
    rng = np.random.default_rng(seed)
    owner = rng.integers(0, CELLS, count)
    eta = change * columns[owner, 0]
    if kind == "scale":
        squares = np.square(rng.standard_normal(count) * np.exp(eta))
        responses: Responses = Squares(seen=squares, number=np.ones(count))
    else:
        usual = np.full(count, USUAL)
        share = np.square(np.maximum(np.sqrt(USUAL) + eta / 2, 0.0))
        responses = Events(seen=(rng.random(count) < share).astype(float), usual=usual)
    name = "scale" if kind == "scale" else "missing"
    variant = RateVariant(owner=owner, count=CELLS, level=np.tile([1.0, 0.0], (CELLS, 1)),
                          columns=columns)  # fmt: skip
    return Channel(
        name=name, responses=responses, level_sd=level_sd_of(responses), picks=(),
        candidates=(RateCandidate(component=component(name, effect), variants=(variant,)),),
    )  # fmt: skip
