"""The flaws of a recipe for each part: kinds, numbers, sizes, severity tiers and places."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from defects.flaw_bank import FlawBank
from defects.kind import Kind
from defects.kinds import KINDS
from defects.kinds.banked import Banked
from files.errors import RecipeError, known
from quantity.distribution import Distribution, Fixed, parse_distribution

VISIBLE = "visible"


@dataclass(frozen=True, kw_only=True, slots=True)
class Tier:
    """A severity: its weight, and its changes of the sizes.

    Parameters
    ----------
    name
        What records call it.
    weight
        How often, relative to the other tiers' weights.
    scale
        Factor on all sizes in mm that this tier doesn't set itself.
    sizes
        Distributions that replace the kind's.
    """

    name: str
    weight: float
    scale: float
    sizes: Mapping[str, Distribution]


@dataclass(frozen=True, kw_only=True, slots=True)
class KindPlan:
    """One kind of flaw in the plan.

    Parameters
    ----------
    kind
        A name in `defects.kinds.KINDS`.
    number
        How many in each part, rounded to whole numbers.
    sizes
        A distribution for each of the kind's sizes.
    tiers
        Severities; at least one.
    path
        Of the kind `bank`: the folder of its reliefs, as the recipe spells it.
    bank
        The reliefs, once they are read.
    """

    kind: str
    number: Distribution
    sizes: Mapping[str, Distribution]
    tiers: tuple[Tier, ...]
    path: str = ""
    bank: FlawBank | None = None

    def draw(self, rng: np.random.Generator) -> tuple[str, Kind]:
        """Draw a tier and one flaw's sizes; return the tier's name and the flaw."""
        weights = np.array([tier.weight for tier in self.tiers])
        tier = self.tiers[int(rng.choice(len(weights), p=weights / weights.sum()))]
        sizes = {**self.sizes, **tier.sizes}
        flaw = KINDS[self.kind].draw(sizes, rng, scale=tier.scale, unscaled=set(tier.sizes))
        if isinstance(flaw, Banked):
            flaw = replace(flaw, bank=self.bank)
        return tier.name, flaw


@dataclass(frozen=True, kw_only=True, slots=True)
class FlawPlan:
    """All flaws of each part.

    Parameters
    ----------
    kinds
        The kinds wanted.
    min_distance_mm
        Least distance between the edges of two flaws.
    where
        Names of regions to place flaws on; empty: all that the scan can see.
    keep_free
        Names of regions that no flaw may touch.
    keep_free_boxes_mm
        Boxes (low, high corner, part frame) that no flaw may touch.
    facet_um
        How far a flaw's facets may stand off its smooth surface.
    tries
        How often a flaw whose boolean fails is drawn again before it is given up.
    """

    kinds: tuple[KindPlan, ...]
    min_distance_mm: float = 1.0
    where: tuple[str, ...] = ()
    keep_free: tuple[str, ...] = ()
    keep_free_boxes_mm: tuple[tuple[tuple[float, ...], tuple[float, ...]], ...] = ()
    facet_um: float = 1.0
    tries: int = 8

    def numbers(self, rng_of: Callable[..., np.random.Generator]) -> dict[str, int]:
        """Draw the number of flaws of each kind in a specimen."""
        return {
            plan.kind: round(plan.number.draw(rng_of("number", plan.kind))) for plan in self.kinds
        }

    def most(self) -> int:
        """Return the largest number of flaws in a specimen."""
        return round(sum(plan.number.limits()[1] for plan in self.kinds))

    @classmethod
    def from_mapping(cls, data: Mapping[str, Any]) -> Self:
        """Read the `flaws:` part of a recipe.

        Parameters
        ----------
        data
            Kinds of flaw by name, each with `number`, sizes and `tiers`; beside them
            `min_distance_mm`, `where` (`visible` or a list of regions), `keep_free` (a list of
            regions and boxes `[[x, y, z], [x, y, z]]`), `facet_um`, `tries`.

        Raises
        ------
        ValueError
            One line: key path, value, and what is allowed.
        """
        if not isinstance(data, Mapping):
            raise ValueError(f"{data!r} must be a mapping of kinds of flaw")
        regions, boxes = _keep_free(data.get("keep_free", ()))
        allowed = [*KINDS, "min_distance_mm", "where", "keep_free", "facet_um", "tries"]
        for key in data:
            if key not in allowed:
                raise RecipeError("unknown key", where=str(key), **known(str(key), allowed))
        return cls(
            kinds=tuple(_kind_plan(name, data[name]) for name in KINDS if name in data),
            where=_where(data.get("where", VISIBLE)),
            keep_free=regions,
            keep_free_boxes_mm=boxes,
            min_distance_mm=_number(data, "min_distance_mm", 1.0, 0.0, 1e6),
            facet_um=_number(data, "facet_um", 1.0, 0.05, 100.0),
            tries=int(_number(data, "tries", 8, 1, 1000)),
        )

    def paths(self) -> set[str]:
        """Return the folders of the banks that the plan draws from."""
        return {plan.path for plan in self.kinds if plan.path}

    def with_banks(self, banks: Mapping[str, FlawBank]) -> "FlawPlan":
        """Return the plan with its banks, by their folders, at hand."""
        if not self.paths():
            return self
        return replace(
            self, kinds=tuple(replace(plan, bank=banks.get(plan.path)) for plan in self.kinds)
        )

    def check_regions(self, regions: Mapping[str, NDArray[np.bool_]]) -> None:
        """Check that a part has all the regions that the plan names.

        Raises
        ------
        ValueError
            One line with the name and those there are.
        """
        for key, names in (("where", self.where), ("keep_free", self.keep_free)):
            for name in names:
                if name not in regions:
                    there = ", ".join(regions) or "none"
                    raise ValueError(f"{key}: no region {name!r} in this part; it has: {there}")


def _number(data: Mapping[str, Any], key: str, default: float, low: float, high: float) -> float:
    value = data.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise ValueError(f"{key}: {value!r} must be a number from {low} to {high}")
    return float(value)


def _where(value: Any) -> tuple[str, ...]:
    if value == VISIBLE:
        return ()
    if isinstance(value, str):
        return (value,)
    if isinstance(value, Sequence) and value and all(isinstance(name, str) for name in value):
        return tuple(value)
    raise ValueError(f"where: {value!r} must be {VISIBLE!r} or a list of regions")


def _keep_free(
    value: Any,
) -> tuple[tuple[str, ...], tuple[tuple[tuple[float, ...], tuple[float, ...]], ...]]:
    entries = [value] if isinstance(value, str) else value
    if not isinstance(entries, Sequence):
        raise ValueError(f"keep_free: {value!r} must be a list of regions and boxes")
    regions, boxes = [], []
    for entry in entries:
        if isinstance(entry, str):
            regions.append(entry)
            continue
        try:
            low, high = (tuple(float(x) for x in corner) for corner in entry)
        except (TypeError, ValueError):
            low, high = (), ()
        ordered = all(a < b and math.isfinite(b - a) for a, b in zip(low, high, strict=False))
        if len(low) != 3 or len(high) != 3 or not ordered:
            raise ValueError(
                f"keep_free: {entry!r} must be a region or a box [[x, y, z], [x, y, z]], low first"
            )
        boxes.append((low, high))
    return tuple(regions), tuple(boxes)


def _sizes(
    kind: str, where: str, data: Mapping[str, Any], beside: Sequence[str]
) -> dict[str, Distribution]:
    """Read the sizes of a kind; `beside` are the other keys of their mapping."""
    of_kind = {size.name: size for size in KINDS[kind].sizes()}
    sizes: dict[str, Distribution] = {}
    for key, value in data.items():
        if key in beside:
            continue
        if key not in of_kind:
            hint = known(str(key), [*of_kind, *beside])
            raise RecipeError("unknown key", where=f"{where}.{key}", **hint)
        try:
            sizes[key] = parse_distribution(value)
        except ValueError as error:
            raise ValueError(f"{where}.{key}: {error}") from None
        if not all(of_kind[key].holds(limit) for limit in sizes[key].limits()):
            raise ValueError(f"{where}.{key}: {value!r} must stay within {of_kind[key].allowed}")
    return sizes


def _kind_plan(kind: str, data: Any) -> KindPlan:
    if isinstance(data, int | float) and not isinstance(data, bool):
        data = {"number": data}
    if not isinstance(data, Mapping):
        raise ValueError(f"{kind}: {data!r} must be a number or a mapping")
    path = _bank_path(kind, data)
    beside = ("number", "tiers", *(("path",) if kind == Banked.name else ()))
    if kind == Banked.name and isinstance(data.get("mirror"), bool):
        data = {**data, "mirror": {"choice": [0, 1]} if data["mirror"] else 0}
    try:
        number = parse_distribution(data.get("number", 1))
    except ValueError as error:
        raise ValueError(f"{kind}.number: {error}") from None
    if number.limits()[0] < 0 or number.limits()[1] > 1000:
        raise ValueError(f"{kind}.number: {data['number']!r} must stay within 0 to 1000")
    return KindPlan(
        kind=kind,
        number=number,
        sizes={**KINDS[kind].typical(), **_sizes(kind, kind, data, beside)},
        tiers=_tiers(kind, data.get("tiers")),
        path=path,
    )


def _bank_path(kind: str, data: Mapping[str, Any]) -> str:
    """Return the folder of a kind's bank: the kind `bank` has one and no other kind does."""
    path = data.get("path")
    if kind != Banked.name:
        if path is not None:
            raise ValueError(f"{kind}.path: only {Banked.name!r} has a path")
        return ""
    if not isinstance(path, str) or not path:
        raise ValueError(
            f"{kind}.path: {path!r} must be the folder of a bank, made by 'flawforge flaw extract'"
        )
    return path


def _tiers(kind: str, data: Any) -> tuple[Tier, ...]:
    if data is None:
        return (Tier(name="", weight=1.0, scale=1.0, sizes={}),)
    if not isinstance(data, Mapping) or not data:
        raise ValueError(f"{kind}.tiers: {data!r} must be a mapping of names to tiers")
    tiers = []
    for name, tier in data.items():
        where = f"{kind}.tiers.{name}"
        if not isinstance(tier, Mapping):
            raise ValueError(f"{where}: {tier!r} must be a mapping with weight, scale or sizes")
        try:
            weight = _number(tier, "weight", 1.0, 0.0, 1e9)
            scale = _number(tier, "scale", 1.0, 1e-3, 1e3)
        except ValueError as error:
            raise ValueError(f"{where}.{error}") from None
        sizes = _sizes(kind, where, tier, beside=("weight", "scale"))
        tiers.append(Tier(name=str(name), weight=weight, scale=scale, sizes=sizes))
    if not sum(tier.weight for tier in tiers) > 0:
        raise ValueError(f"{kind}.tiers: at least one weight must be above 0")
    return tuple(tiers)


def exactly(
    kind: str, number: int = 1, bank: FlawBank | None = None, **sizes: float
) -> KindPlan:
    """Return a plan for `number` flaws of a kind with the given sizes; others are typical."""
    fixed = {name: Fixed(value=value) for name, value in sizes.items()}
    return KindPlan(
        kind=kind,
        number=Fixed(value=number),
        sizes={**KINDS[kind].typical(), **fixed},
        tiers=(Tier(name="", weight=1.0, scale=1.0, sizes={}),),
        bank=bank,
    )
