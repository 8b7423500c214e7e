"""A recipe's JSON Schema, from the types that check it: for editors, and for docs/recipe.md."""

import dataclasses
import math
import types
import typing
from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal, get_args, get_origin

from defects.kind import Kind
from defects.kinds import KINDS
from defects.kinds.banked import Banked
from files.plain_data import plain
from pipeline.injection.flawplan import FlawPlan
from pipeline.recipe import RecipeFile
from quantity import Quantity, quantities
from quantity.distribution import Distribution

Schema = dict[str, Any]

FILE_NAME: Final = "flawforge-recipe.schema.json"
MODELINE: Final = f"# yaml-language-server: $schema={FILE_NAME}"
NUMBERS: Final = {int: "integer", float: "number", bool: "boolean", str: "string"}
MEANINGS: Final = {  # of what isn't a quantity, which says it itself
    "RecipeFile.name": "name of the dataset: letters, digits, '.', '_', '-'",
    "RecipeFile.sensor": "a preset, or a sensor.yaml beside the recipe",
    "RecipeFile.parts": "what is scanned",
    "RecipeFile.surface": "roughness: a preset, or a surface.yaml; without it there is no speckle",
    "RecipeFile.reflectance": "brightness of the parts, for effects that depend on it",
    "RecipeFile.intensity": "store the brightness of the laser line, too; {} for typical values",
    "RecipeFile.flaws": "kinds of flaw and where they may sit",
    "RecipeFile.motion": "limits of the sensor's path",
    "RecipeFile.split_by": "what is never in two splits; by part where there are enough of them",
    "RecipeFile.points_on_disk": "store each point's place in the part frame, too",
    "RecipeFile.compression": "of the shards; any HDF5 reads deflate and none, zstd and lz4 read "
    "faster and need hdf5plugin",
    "PartEntry.builtin": "a built-in part",
    "PartEntry.path": "mesh files, a path or a glob below the recipe's folder",
    "PartEntry.name": "what the part is called in the dataset; the file's name where left out",
    "PartEntry.parameters": "sizes of a built-in part",
    "PartEntry.unit": "unit of the mesh's coordinates",
    "PartEntry.thicken_mm": "thickness given to an open sheet, mm",
    "PartEntry.surface": "roughness of this part in place of the recipe's",
    "PartEntry.flaws": "flaws of this part in place of the recipe's",
    "PartEntry.motion": "path over this part in place of the recipe's",
    "Motion.look": "direction in which the sensor looks, part frame",
    "Motion.travel": "direction of the travel, part frame",
    "Motion.path": "a path of its own, in place of the limits above",
    "WaypointPath.waypoints": "places along the path, two at least",
    "WaypointPath.relative_to": "origin of the waypoints: part_frame or part_centre",
    "Waypoint.at_mm": "place of the sensor's origin, mm",
    "Waypoint.roll_deg": "turn about the travel, °",
    "Waypoint.pitch_deg": "turn about the laser line, °",
    "Waypoint.yaw_deg": "turn about the laser's axis, °",
    "ReflectanceMap.picture": "a grey picture laid over the part",
    "ReflectanceMap.stripes": "stripes over it",
    "ReflectanceMap.patches": "rectangles over it",
    "Picture.path": "PNG or NPY below the recipe's folder",
    "Picture.x_mm": "its extent along x, part frame, mm",
    "Picture.y_mm": "its extent along y, part frame, mm",
    "Patch.x_mm": "its extent along x, part frame, mm",
    "Patch.y_mm": "its extent along y, part frame, mm",
    "Stripes.across": "axis across which they lie",
    "Stripes.start_mm": "where the first begins, mm",
}
PLAN_KEYS: Final[Mapping[str, Schema]] = {
    "min_distance_mm": {
        "type": "number", "minimum": 0, "maximum": 1e6, "default": 1.0,
        "description": "least distance between the edges of two flaws, mm",
    },
    "where": {
        "anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}],
        "default": "visible",
        "description": "'visible', or regions of the part that flaws sit on",
    },
    "keep_free": {
        "anyOf": [{"type": "string"}, {"type": "array"}], "default": [],
        "description": "regions, or boxes [[x, y, z], [x, y, z]] in mm, that stay as they are",
    },
    "facet_um": {
        "type": "number", "minimum": 0.05, "maximum": 100, "default": 1.0,
        "description": "how far a flaw's facets may stand off its smooth surface, µm",
    },
    "tries": {
        "type": "integer", "minimum": 1, "maximum": 1000, "default": 8,
        "description": "how often a flaw that can't be cut is drawn again",
    },
}  # fmt: skip


def schema() -> Schema:
    """Return the JSON Schema (draft 2020-12) of a recipe."""
    definitions: dict[str, Schema] = {}
    top = _record(RecipeFile, definitions)
    required = top.pop("required")
    top["properties"]["extends"] = {
        "type": "string",
        "description": "a recipe, by path or name, for all that this one leaves out",
    }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "flawforge recipe",
        **top,
        "anyOf": [{"required": required}, {"required": ["extends"]}],
        "$defs": {"flaws": _flaws(), **definitions},
    }


def _record(cls: type[Any], definitions: dict[str, Schema]) -> Schema:
    """Return the schema of a record: its fields, which are required, and nothing else."""
    known: dict[str, Quantity] = {q.name: q for q in quantities(cls)}
    hints = typing.get_type_hints(cls, include_extras=True)
    properties, required = {}, []
    for field in dataclasses.fields(cls):
        quantity = known.get(field.name)
        found = _of(hints[field.name], quantity, definitions)
        meaning = quantity.meaning if quantity else MEANINGS[f"{cls.__name__}.{field.name}"]
        unit = f", {quantity.unit}" if quantity and quantity.unit else ""
        found = {**found, "description": f"{meaning}{unit}"}
        if field.default is not dataclasses.MISSING:
            if field.default is not None:
                found["default"] = plain(field.default)
        elif field.default_factory is not dataclasses.MISSING:
            if not dataclasses.is_dataclass(made := field.default_factory()):
                found["default"] = plain(made)
        else:
            required.append(field.name)
        properties[field.name] = found
    return {
        "type": "object", "properties": properties, "additionalProperties": False,
        **({"required": required} if required else {}),
    }  # fmt: skip


def _of(hint: Any, quantity: Quantity | None, definitions: dict[str, Schema]) -> Schema:
    """Return the schema of a type."""
    origin, inner = get_origin(hint), get_args(hint)
    if hint is Distribution or hint is FlawPlan:
        return _size(quantity) if hint is Distribution else {"$ref": "#/$defs/flaws"}
    if origin is Annotated:
        return _of(inner[0], quantity, definitions)
    if origin in (types.UnionType, typing.Union):
        some = [_of(one, quantity, definitions) for one in inner if one is not type(None)]
        return {"anyOf": [*some, {"type": "null"}]} if type(None) in inner else {"anyOf": some}
    if origin is Literal:
        return {"enum": list(inner)}
    if origin is tuple and inner[-1] is Ellipsis:
        return {"type": "array", "items": _of(inner[0], quantity, definitions)}
    if origin is tuple:
        items = _of(inner[0], quantity, definitions)
        return {"type": "array", "items": items, "minItems": len(inner), "maxItems": len(inner)}
    if origin is dict:
        return {
            "type": "object", "additionalProperties": _of(inner[1], quantity, definitions)
        }  # fmt: skip
    if dataclasses.is_dataclass(hint):
        name = getattr(hint, "__name__", "")
        if name not in definitions:
            definitions[name] = {}
            definitions[name] = _record(typing.cast(type[Any], hint), definitions)
        return {"$ref": f"#/$defs/{name}"}
    return {"type": NUMBERS[hint], **_bounds(quantity)}


def _bounds(quantity: Quantity | None) -> Schema:
    if quantity is None:
        return {}
    found: Schema = {}
    if math.isfinite(quantity.low):
        found["exclusiveMinimum" if quantity.above else "minimum"] = quantity.low
    if math.isfinite(quantity.high):
        found["exclusiveMaximum" if quantity.below else "maximum"] = quantity.high
    return found


def _size(quantity: Quantity | None) -> Schema:
    """Return the schema of a size: a number, or one distribution with its figures."""
    number = {"type": "number", **_bounds(quantity)}
    lists = {
        "uniform": {"items": number, "minItems": 2, "maxItems": 2},
        "log_uniform": {"items": number, "minItems": 2, "maxItems": 2},
        "normal": {"items": {"type": "number"}, "minItems": 4, "maxItems": 4},
        "choice": {"items": number, "minItems": 1},
    }
    drawn = [
        {
            "type": "object", "properties": {name: {"type": "array", **figures}},
            "required": [name], "additionalProperties": False,
        }
        for name, figures in lists.items()
    ]  # fmt: skip
    return {"anyOf": [number, *drawn]}


def _flaws() -> Schema:
    """Return the schema of `flaws:`: each kind, a number or a mapping, and what holds for all."""
    number = Quantity(meaning="how many in each specimen", low=0, high=1000)
    kinds = {name: _kind(kind, number) for name, kind in KINDS.items()}
    return {
        "type": "object", "properties": {**kinds, **PLAN_KEYS}, "additionalProperties": False
    }  # fmt: skip


def _kind(kind: type[Kind], number: Quantity) -> Schema:
    sizes: dict[str, Schema] = {}
    for size in kind.sizes():
        unit = f", {size.unit}" if size.unit else ""
        low, high = size.typical
        sizes[size.name] = {
            **_size(size),
            "description": f"{size.meaning}{unit}; {low:g} to {high:g} where left out",
        }
    if kind is Banked:
        sizes["mirror"]["anyOf"].append({"type": "boolean"})
    tier = {
        "type": "object",
        "properties": {
            "weight": {"type": "number", "minimum": 0, "description": "how often"},
            "scale": {"type": "number", "minimum": 1e-3, "maximum": 1e3,
                      "description": "factor on the sizes in mm that it doesn't set"},
            **sizes,
        },
        "additionalProperties": False,
    }  # fmt: skip
    own = {
        "number": {**_size(number), "default": 1, "description": number.meaning},
        "tiers": {"type": "object", "additionalProperties": tier, "description": "severities"},
        **sizes,
    }
    alone: Schema = {"type": "number", "minimum": 0, "maximum": 1000}
    mapping: Schema = {"type": "object", "properties": own, "additionalProperties": False}
    if kind is Banked:
        alone, mapping = {"not": {}}, {**mapping, "required": ["path"]}
        mapping["properties"] = {
            "path": {
                "type": "string",
                "description": "folder of the bank below the recipe's, of `flawforge flaw extract`",
            },
            **own,
        }
    about = " ".join((kind.__doc__ or "").split("\n\n")[0].split())
    return {
        "anyOf": [alone, mapping], "description": about
    }  # fmt: skip
