"""Seats of kinds of flaws: the skin, outer or inner edges, rims of holes."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from defects.seats.feature_edges import feature_edges, site_on_edge
from defects.seats.holes import holes
from defects.surface.surface import Site, SiteError, Surface

Floats = NDArray[np.float64]


class Seat(ABC):
    """Draws places for one kind of flaw; `weight` (F,) is the weight of each face."""

    __slots__ = ()

    @abstractmethod
    def sites(
        self, surface: Surface, rng: np.random.Generator, count: int, weight: Floats
    ) -> list[Site]:
        """Draw `count` places.

        Raises
        ------
        SiteError
            When the part has none.
        """


@dataclass(frozen=True, kw_only=True, slots=True)
class Skin(Seat):
    """Anywhere on the part's faces, uniformly by area."""

    def sites(
        self, surface: Surface, rng: np.random.Generator, count: int, weight: Floats
    ) -> list[Site]:
        """Draw `count` places by area."""
        return surface.random_sites(rng, count, weight)


@dataclass(frozen=True, kw_only=True, slots=True)
class Edge(Seat):
    """On the part's feature edges, uniformly by length.

    Parameters
    ----------
    convex
        Outer edges, or inner ones.
    """

    convex: bool

    def sites(
        self, surface: Surface, rng: np.random.Generator, count: int, weight: Floats
    ) -> list[Site]:
        """Draw `count` places by length; an edge is wanted where a face beside it is."""
        chains = [chain for chain in feature_edges(surface) if chain.convex == self.convex]
        if not chains:
            raise SiteError(f"the part has no {'convex' if self.convex else 'concave'} edge")
        step = np.concatenate([np.diff(chain.knots_mm) for chain in chains])
        start = np.concatenate([chain.knots_mm[:-1] for chain in chains])
        owner = np.repeat(np.arange(len(chains)), [len(chain.left_faces) for chain in chains])
        wanted = np.concatenate(
            [np.maximum(weight[chain.left_faces], weight[chain.right_faces]) for chain in chains]
        )
        total = np.cumsum(step * wanted)
        if not total[-1] > 0:
            raise SiteError("no edge is left to place flaws on")
        at = np.searchsorted(total, rng.uniform(0.0, total[-1], count), side="right")
        pieces = np.minimum(at, len(step) - 1)
        share = rng.uniform(size=count)
        return [
            site_on_edge(chains[owner[k]], float(start[k] + s * step[k]))
            for k, s in zip(pieces, share, strict=True)
        ]


@dataclass(frozen=True, kw_only=True, slots=True)
class HoleRim(Seat):
    """At the rim of a round hole, each hole as likely as the others."""

    def sites(
        self, surface: Surface, rng: np.random.Generator, count: int, weight: Floats
    ) -> list[Site]:
        """Draw `count` holes; a hole is wanted where the face around its rim is."""
        found = [hole for hole in holes(surface) if weight[hole.chain.left_faces].any()
                 or weight[hole.chain.right_faces].any()]  # fmt: skip
        if not found:
            raise SiteError("the part has no round hole that is wanted here")
        which = rng.integers(len(found), size=count)
        share = rng.uniform(size=count)
        return [
            site_on_edge(found[k].chain, float(s * found[k].chain.knots_mm[-1]))
            for k, s in zip(which, share, strict=True)
        ]
