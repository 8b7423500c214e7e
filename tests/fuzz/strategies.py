"""Sensors, surfaces and recipes from the keys and bounds that the code itself declares."""

import math
from typing import Any

import numpy as np
from hypothesis import strategies as st

from defects.kinds import KINDS
from pipeline.parts.builtin import NAMES, parameters_of
from pipeline.recipe import Motion, PartEntry, RecipeFile
from quantity import Quantity, quantities
from sensors.datasheet import Datasheet
from sensors.effects import CATALOGUE
from sensors.surface.surface import Surface
from tests.support.mutation import of_data

SIZES = {name: quantities(parameters_of(name)) for name in NAMES}


def value(known: Quantity) -> st.SearchStrategy[Any]:
    """Draw a number within the bounds; a wide one where they are open."""
    low = known.low if math.isfinite(known.low) else -1e3
    high = known.high if math.isfinite(known.high) else max(abs(low), 1.0) * 1e3
    if known.whole:
        return st.integers(math.ceil(low), max(math.floor(min(high, 50)), math.ceil(low)))
    return st.floats(low, high, exclude_min=known.above, exclude_max=known.below)


def drawn(known: Quantity) -> st.SearchStrategy[Any]:
    """Draw a number, or a distribution as recipes spell it."""
    one = value(known)
    pair = st.tuples(one, one).map(sorted)
    return st.one_of(
        one,
        pair.map(lambda ends: {"uniform": ends}),
        pair.map(lambda ends: {"log_uniform": ends}),
        st.lists(one, min_size=1, max_size=3).map(lambda several: {"choice": several}),
    )


def some(cls: type, make: Any, *, needed: bool = False) -> st.SearchStrategy[dict[str, Any]]:
    """Draw a part of a record's numbers; with `needed`, all that have no default."""
    known = {one.name: one for one in quantities(cls)}
    must = {k: make(q) for k, q in known.items() if needed and q.default is None}
    return st.fixed_dictionaries(
        must, optional={k: make(q) for k, q in known.items() if k not in must}
    )


def joined(*parts: st.SearchStrategy[dict[str, Any]]) -> st.SearchStrategy[dict[str, Any]]:
    """Draw from each and put all keys into one mapping."""
    return st.tuples(*parts).map(lambda some: {k: v for one in some for k, v in one.items()})


def effect(name: str) -> st.SearchStrategy[dict[str, Any]]:
    """Draw an entry of a sensor's `effects:`."""
    return some(CATALOGUE[name], value).map(lambda numbers: {"name": name, **numbers})


def sensors() -> st.SearchStrategy[dict[str, Any]]:
    """Draw a sensor's file."""
    effects = st.lists(st.sampled_from(sorted(CATALOGUE)).flatmap(effect), max_size=2)
    return joined(
        some(Datasheet, value, needed=True), st.fixed_dictionaries({"effects": effects}),
        st.fixed_dictionaries({
            "name": st.text(max_size=8), "columns": st.sampled_from(["even_angle", "even_x"]),
            "camera_side": st.sampled_from(["+y", "-y"]),
        }),
    )  # fmt: skip


def surfaces() -> st.SearchStrategy[dict[str, Any]]:
    """Draw a surface's file."""
    return joined(
        some(Surface, value, needed=True), st.fixed_dictionaries({"name": st.text(max_size=8)})
    )


def flaw(name: str) -> st.SearchStrategy[dict[str, Any]]:
    """Draw a kind's entry under `flaws:`."""
    number = st.one_of(st.integers(0, 3), st.just({"choice": [0, 2]}))
    entry = joined(some(KINDS[name], drawn), st.fixed_dictionaries({}, optional={"number": number}))
    return entry.map(lambda numbers: {name: numbers})


def parts() -> st.SearchStrategy[dict[str, Any]]:
    """Draw an entry of `parts:`."""

    def one(name: str) -> st.SearchStrategy[dict[str, Any]]:
        sizes = st.fixed_dictionaries({}, optional={q.name: value(q) for q in SIZES[name]})
        return st.fixed_dictionaries({"builtin": st.just(name), "parameters": sizes})

    return joined(st.sampled_from(NAMES).flatmap(one), some(PartEntry, value))


def recipes() -> st.SearchStrategy[dict[str, Any]]:
    """Draw a recipe that names sensor.yaml and surface.yaml beside it."""
    flaws = st.lists(st.sampled_from(sorted(KINDS)).flatmap(flaw), max_size=2).map(
        lambda several: {k: v for one in several for k, v in one.items()}
    )
    words = st.fixed_dictionaries({
        "name": st.from_regex(r"[a-z0-9._-]{1,9}", fullmatch=True), "flaws": flaws,
        "sensor": st.just("sensor.yaml"), "surface": st.just("surface.yaml"),
        "parts": st.lists(parts(), min_size=1, max_size=2), "motion": some(Motion, drawn),
        "splits": st.sampled_from([{"train": 1.0}, {"train": 0.5, "test": 0.5}]),
    })  # fmt: skip
    return joined(some(RecipeFile, value, needed=True), words)


def mutated(data: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    """Draw data as they stand, or with the campaign's mutations."""
    return st.tuples(data, st.none() | st.integers(0, 2**32)).map(
        lambda drawn: drawn[0] if drawn[1] is None else of_data(
            drawn[0], np.random.default_rng(drawn[1])
        )
    )  # fmt: skip
