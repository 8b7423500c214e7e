"""Injection: flaws drawn from a plan, placed on a part, carved into it, and recorded."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from defects.carving.block import Block
from defects.carving.point_in_mesh import Inside
from defects.carving.solid import BooleanError, Change, Cutter
from defects.carving.stitch import Carved
from defects.flaw_bank import FlawBank
from defects.kind import Kind
from defects.kinds import KINDS
from defects.kinds.banked import Banked
from defects.surface.surface import Site, SiteError, Surface
from pipeline.injection.flawed_part import Flaw, FlawedPart
from pipeline.injection.flawplan import FlawPlan, KindPlan
from pipeline.injection.spacing import Footprint
from pipeline.parts.part import Part

__all__ = ["Flaw", "FlawedPart", "cutter_of", "inject"]

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

PLACES = 60
"""How many places are tried for a flaw, over all its draws, before it is given up."""
NO_ROOM = 10
"""After so many flaws of a kind given up in a row, the rest of the kind is dropped untried."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Placed:
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


class _Misplaced(Exception):
    """The flaw doesn't fit at the place drawn; the reason in words."""


def inject(
    part: Part,
    plan: FlawPlan,
    *,
    rng_of: Callable[..., np.random.Generator],
    visible_faces: NDArray[Any] | None = None,
    visible_at: Callable[[Floats], Bools] | None = None,
    surface: Surface | None = None,
) -> FlawedPart:
    """Draw a plan's flaws and carve them into a part.

    Parameters
    ----------
    part
        The unflawed part; never written to.
    plan
        What is wanted.
    rng_of
        Named streams of randomness: the numbers come from `rng_of("number", kind)`, the seed of
        each flaw from `rng_of("flaw", kind, i)`.
    visible_faces
        (F,) bool or weights: where flaws may sit if the plan names no regions; None: anywhere.
    visible_at
        Tells which of some points (k, 3) the scan can see, for parts whose faces are larger than
        the scan; None: all.
    surface
        `Surface.of(part.vertices_mm, part.faces)`, where it was built before.

    Returns
    -------
    FlawedPart
        With as many flaws as found a place.

    Raises
    ------
    ValueError
        When the plan names regions that the part doesn't have, or `visible_faces` doesn't fit.
    """
    plan.check_regions(part.regions)
    skin = surface or Surface.of(part.vertices_mm, part.faces)
    forbidden = np.zeros(len(part.faces), np.bool_)
    for name in plan.keep_free:
        forbidden |= part.regions[name]
    search = _Search(
        surface=skin, block=_block(part), plan=plan, allowed=_allowed(part, plan, visible_faces),
        forbidden=forbidden, visible_at=visible_at,
    )  # fmt: skip
    redrawn = misplaced = 0
    placed: list[_Placed] = []
    dropped: list[str] = []
    numbers = plan.numbers(rng_of)
    for kind_plan in plan.kinds:
        given_up = 0
        for i in range(numbers[kind_plan.kind]):
            if given_up == NO_ROOM:
                dropped.append(f"{kind_plan.kind} {i}: no room; {NO_ROOM} before it found none")
                continue
            seed = int(rng_of("flaw", kind_plan.kind, i).integers(2**63))
            tries = search.place(kind_plan, i, placed, seed)
            if tries.placed is None:
                dropped.append(f"{kind_plan.kind} {i}: {tries.reason}")
                given_up += 1
            else:
                placed.append(tries.placed)
                given_up = 0
            redrawn += tries.failed
            misplaced += tries.missed
    carved, placed, lost = _carve(search.block, part, placed)
    return FlawedPart(
        part=part,
        vertices_mm=carved.vertices_mm,
        faces=carved.faces,
        instance=carved.instance,
        source_face=carved.source_face,
        flaws=tuple(_record(i, one) for i, one in enumerate(placed, start=1)),
        cutters=tuple(one.cutter for one in placed),
        redrawn=redrawn + len(lost),
        misplaced=misplaced,
        dropped=(*dropped, *lost),
        solids=tuple((_inside(one.cutter.removed), _inside(one.cutter.added)) for one in placed),
    )


def cutter_of(
    surface: Surface, flaw: Flaw, facet_um: float = 1.0, bank: FlawBank | None = None
) -> Cutter:
    """Build the cutter of a recorded flaw from its record.

    Parameters
    ----------
    surface
        Of the unflawed part.
    flaw
        The record.
    facet_um
        The plan's.
    bank
        Of real flaws, for a flaw that was taken from one.
    """
    site = Site(
        position_mm=flaw.position_mm,
        normal=flaw.normal,
        heading_rad=flaw.heading_rad,
        triangle=flaw.triangle,
    )
    kind = KINDS[flaw.kind](**flaw.parameters)
    if isinstance(kind, Banked):
        kind = replace(kind, bank=bank)
    return kind.cutter(surface, site, _shape_rng(flaw.seed, flaw.attempt), facet_um * 1e-3)


@lru_cache(maxsize=2)
def _block(part: Part) -> Block:
    """Return the part ready for carving; kept, since many specimens come from one part."""
    return Block(part.vertices_mm, part.faces)


def _shape_rng(seed: int, attempt: int) -> np.random.Generator:
    return np.random.default_rng([seed, attempt, 1])


def _allowed(part: Part, plan: FlawPlan, visible: NDArray[Any] | None) -> Floats:
    """Return the weight (F,) with which flaws sit on each face."""
    if plan.where:
        chosen: Bools = np.any([part.regions[name] for name in plan.where], axis=0)
        return chosen.astype(np.float64)
    if visible is None:
        return np.ones(len(part.faces))
    weight = np.asarray(visible, np.float64)
    if weight.shape != (len(part.faces),):
        raise ValueError(f"visible_faces has shape {weight.shape}, not ({len(part.faces)},)")
    return weight


@dataclass(frozen=True, kw_only=True, slots=True)
class _Tries:
    """How the search for a flaw's place ended: the flaw, or why there is none, and what failed."""

    placed: _Placed | None
    failed: int
    missed: int
    reason: str


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Search:
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
        self, kind_plan: KindPlan, number: int, placed: Sequence[_Placed], seed: int
    ) -> _Tries:
        """Draw a flaw until it has a place beside those that are placed, or tries are used up."""
        failed, missed, reason = 0, 0, ""
        while failed < self.plan.tries and missed < PLACES:
            try:
                found = self._try(kind_plan, number, placed, seed, failed + missed)
                return _Tries(placed=found, failed=failed, missed=missed, reason="")
            except BooleanError as error:
                failed += 1
                reason = str(error)
            except (SiteError, _Misplaced) as error:
                missed += 1
                reason = str(error)
        return _Tries(placed=None, failed=failed, missed=missed, reason=reason)

    def _try(
        self,
        kind_plan: KindPlan,
        number: int,
        placed: Sequence[_Placed],
        seed: int,
        attempt: int,
    ) -> _Placed:
        """Draw one flaw, place it, build it and check it."""
        rng = np.random.default_rng([seed, attempt, 0])
        tier, flaw = kind_plan.draw(rng)
        sites = flaw.seat.sites(self.surface, rng, 64, self.allowed * ~self.forbidden)
        if self.visible_at is not None:
            seen = self.visible_at(np.stack([site.position_mm for site in sites]))
            sites = [site for site, good in zip(sites, seen, strict=True) if good]
        if not sites:
            raise _Misplaced("no visible place found")
        site, apart_mm = sites[0], self.plan.min_distance_mm
        for other in placed:
            near = max(apart_mm, other.footprint.spacing_mm)
            if other.footprint.tree.query(site.position_mm)[0] < near:
                raise _Misplaced("too near to another flaw")
        cutter = flaw.cutter(
            self.surface, site, _shape_rng(seed, attempt), self.plan.facet_um * 1e-3
        )
        _check_free(self.surface, self.plan, cutter, self.forbidden)
        footprint = Footprint.of(cutter, apart_mm)
        if any(footprint.is_near(other.footprint, apart_mm) for other in placed):
            raise _Misplaced("too near to another flaw")
        return _Placed(
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
            raise _Misplaced("on a place to be kept free")
    if forbidden.any() and forbidden[surface.project(cutter.skin_mm)[2]].any():
        raise _Misplaced("on a region to be kept free")


def _carve(
    block: Block, part: Part, placed: list[_Placed]
) -> tuple[Carved, list[_Placed], list[str]]:
    """Carve all at once; should that fail, one after the other, leaving out what fails."""
    if not placed:
        count = len(part.faces)
        untouched = Carved(
            vertices_mm=part.vertices_mm,
            faces=part.faces,
            instance=np.zeros(count, np.uint16),
            source_face=np.arange(count, dtype=np.int32),
        )
        return untouched, [], []

    def carve(some: list[_Placed]) -> Carved:
        return block.carve([one.cutter for one in some], [one.change for one in some])

    try:
        return carve(placed), placed, []
    except BooleanError:
        kept: list[_Placed] = []
        lost: list[str] = []
        for one in placed:
            try:
                carve([*kept, one])
                kept.append(one)
            except BooleanError as error:
                lost.append(f"{one.plan.kind} {one.number}: {error}")
        return (carve(kept) if kept else _carve(block, part, [])[0]), kept, lost


def _inside(solid: Any) -> Inside | None:
    return None if solid is None else Inside.of(solid.vertices_mm, solid.faces)


def _record(instance: int, one: _Placed) -> Flaw:
    change = one.change
    return Flaw(
        instance=instance,
        kind=one.plan.kind,
        class_id=one.flaw.class_id,
        tier=one.tier,
        source=one.flaw.source,
        parameters=one.flaw.parameters(),
        position_mm=one.site.position_mm,
        normal=one.site.normal,
        heading_rad=one.site.heading_rad,
        triangle=one.site.triangle,
        removed_mm3=change.removed_mm3,
        added_mm3=change.added_mm3,
        opening_mm2=change.opening_mm2,
        depth_mm=change.depth_mm,
        through=change.through,
        seed=one.seed,
        attempt=one.attempt,
    )
