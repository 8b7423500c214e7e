"""Placement: a flaw is drawn until it fits on the part beside those that are placed."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from defects.carving.block import Block
from defects.carving.solid import BooleanError, Change, Cutter
from defects.kind import Kind
from defects.surface.surface import Site, SiteError, Surface
from pipeline.injection.flawplan import FlawPlan, KindPlan
from pipeline.injection.spacing import Footprint

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

PLACES = 60
"""How many places are tried for a flaw, over all its draws, before it is given up."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Placed:
    """A flaw that passed all its checks, with its footprint for the distance to others."""

    plan: KindPlan
    number: int
    tier: str
    flaw: Kind
    site: Site
    cutter: Cutter
    change: Change
    seed: int
    attempt: int
    footprint: Footprint


class Misplaced(Exception):
    """The flaw doesn't fit at the place drawn; the reason in words."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Tries:
    """How the search for a flaw's place ended: the flaw, or why there is none, and what failed."""

    placed: Placed | None
    failed: int
    missed: int
    reason: str


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Search:
    """Where the flaws of a plan may sit on a part.

    Attributes
    ----------
    allowed : (F,) weight of each face
    forbidden : (F,) faces that stay free
    visible_at : tells which of some points the scan can see; None: all
    """

    surface: Surface
    block: Block
    plan: FlawPlan
    allowed: Floats
    forbidden: Bools
    visible_at: Callable[[Floats], Bools] | None

    def place(
        self, kind_plan: KindPlan, number: int, placed: Sequence[Placed], seed: int
    ) -> Tries:
        """Draw a flaw until it has a place beside those that are placed, or tries are used up."""
        failed, missed, reason = 0, 0, ""
        while failed < self.plan.tries and missed < PLACES:
            try:
                found = self._try(kind_plan, number, placed, seed, failed + missed)
                return Tries(placed=found, failed=failed, missed=missed, reason="")
            except BooleanError as error:
                failed += 1
                reason = str(error)
            except (SiteError, Misplaced) as error:
                missed += 1
                reason = str(error)
        return Tries(placed=None, failed=failed, missed=missed, reason=reason)

    def _try(
        self,
        kind_plan: KindPlan,
        number: int,
        placed: Sequence[Placed],
        seed: int,
        attempt: int,
    ) -> Placed:
        """Draw one flaw, place it, build it and check it."""
        rng = np.random.default_rng([seed, attempt, 0])
        tier, flaw = kind_plan.draw(rng)
        sites = flaw.seat.sites(self.surface, rng, 64, self.allowed * ~self.forbidden)
        if self.visible_at is not None:
            seen = self.visible_at(np.stack([site.position_mm for site in sites]))
            sites = [site for site, good in zip(sites, seen, strict=True) if good]
        if not sites:
            raise Misplaced("no visible place found")
        site = sites[0]
        for other in placed:
            if other.footprint.is_near_point(site.position_mm):
                raise Misplaced("too near to another flaw")
        cutter = flaw.cutter(
            self.surface, site, shape_rng(seed, attempt), self.plan.facet_um * 1e-3
        )
        _check_free(self.surface, self.plan, cutter, self.forbidden)
        footprint = Footprint(cutter, self.plan.min_distance_mm)
        if any(footprint.is_near(other.footprint) for other in placed):
            raise Misplaced("too near to another flaw")
        return Placed(
            plan=kind_plan,
            number=number,
            tier=tier,
            flaw=flaw,
            site=site,
            cutter=cutter,
            change=self.block.trial(cutter),
            seed=seed,
            attempt=attempt,
            footprint=footprint,
        )


def _check_free(surface: Surface, plan: FlawPlan, cutter: Cutter, forbidden: Bools) -> None:
    for low, high in plan.keep_free_boxes_mm:
        if ((cutter.skin_mm >= low) & (cutter.skin_mm <= high)).all(axis=1).any():
            raise Misplaced("on a place to be kept free")
    if forbidden.any() and forbidden[surface.project(cutter.skin_mm)[2]].any():
        raise Misplaced("on a region to be kept free")


def shape_rng(seed: int, attempt: int) -> np.random.Generator:
    """Return the stream of a flaw's shape at an attempt."""
    return np.random.default_rng([seed, attempt, 1])
