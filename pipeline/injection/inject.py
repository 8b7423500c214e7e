"""Injection: flaws drawn from a plan, placed on a part, carved into it, and recorded."""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from defects.carving.block import Block
from defects.carving.point_in_mesh import Inside
from defects.carving.solid import BooleanError, Cutter
from defects.carving.stitch import Carved
from defects.flaw_bank import FlawBank
from defects.kinds import KINDS
from defects.kinds.banked import Banked
from defects.surface.surface import Site, Surface
from pipeline.injection.flawed_part import Flaw, FlawedPart
from pipeline.injection.flawplan import FlawPlan
from pipeline.injection.placement import Placed, Search, shape_rng
from pipeline.parts.part import Part

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

NO_ROOM = 10
"""After so many flaws of a kind given up in a row, the rest of the kind is dropped untried."""


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
    search = Search(
        surface=skin, block=_block(part), plan=plan, allowed=_allowed(part, plan, visible_faces),
        forbidden=forbidden, visible_at=visible_at,
    )  # fmt: skip
    redrawn = misplaced = 0
    placed: list[Placed] = []
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
    return kind.cutter(surface, site, shape_rng(flaw.seed, flaw.attempt), facet_um * 1e-3)


@lru_cache(maxsize=2)
def _block(part: Part) -> Block:
    """Return the part ready for carving; kept, since many specimens come from one part."""
    return Block(part.vertices_mm, part.faces)


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


def _carve(
    block: Block, part: Part, placed: list[Placed]
) -> tuple[Carved, list[Placed], list[str]]:
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

    def carve(some: list[Placed]) -> Carved:
        return block.carve([one.cutter for one in some], [one.change for one in some])

    try:
        return carve(placed), placed, []
    except BooleanError:
        kept: list[Placed] = []
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


def _record(instance: int, one: Placed) -> Flaw:
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
