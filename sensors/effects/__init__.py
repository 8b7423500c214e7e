"""Physics beyond the plain geometric model, one effect a file, and the catalogue of them."""

from collections.abc import Mapping
from typing import Any

from sensors.datasheet import Datasheet
from sensors.effects.base import AdditiveEffect, Basis, Effect, MotionEffect
from sensors.effects.camera_occlusion import CameraOcclusion
from sensors.effects.parameter import Parameter
from sensors.typed_yaml import RecipeError

__all__ = [
    "CATALOGUE",
    "AdditiveEffect",
    "Basis",
    "Effect",
    "MotionEffect",
    "Parameter",
    "effect_of",
    "effects_of",
]

CATALOGUE: dict[str, type[Effect]] = {effect.name: effect for effect in (CameraOcclusion,)}


def effect_of(mapping: Mapping[str, Any], *, where: str = "effects") -> Effect:
    """Build one effect from its entry in a sensor's `effects`.

    Raises
    ------
    RecipeError
        For an unknown effect, an unknown key, or a value out of its bounds.
    """
    name = mapping.get("name")
    if name not in CATALOGUE:
        raise RecipeError(
            "no such effect", where=where, value=name, allowed=", ".join(sorted(CATALOGUE))
        )
    return CATALOGUE[name].from_mapping(mapping, where=where)


def effects_of(datasheet: Datasheet) -> tuple[Effect, ...]:
    """Build the effects that a sensor's file lists, in order.

    Raises
    ------
    RecipeError
        For an entry that isn't right, naming the sensor and the entry.
    """
    place = f"sensor '{datasheet.name}'"
    return tuple(
        effect_of(entry, where=f"{place}: effects[{i}]")
        for i, entry in enumerate(datasheet.effects)
    )
