"""A specimen: one part with its flaws, ready for scans; and the storage of parts.

Parts are loaded, mended and checked once for a dataset and kept beside the shards while it is
made, so that every worker starts from the same solid without repeating that work. So are flawed
parts of which several workers take scans.
"""

import hashlib
import io
import json
import os
import uuid
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from defects.surface.surface import Surface
from pipeline.batch.plan import PlannedPart
from pipeline.injection.cut_once import cut_once
from pipeline.injection.flawed_part import FlawedPart
from pipeline.injection.inject import inject
from pipeline.motion.aim import Aimer, Outlook
from pipeline.parts import builtin as parts
from pipeline.parts.part import Part, load_part
from pipeline.parts.part_error import PartError
from pipeline.passes.set_cover import planned_passes
from pipeline.passes.straight_passes import Pass
from pipeline.recipe import PartEntry, Recipe
from pipeline.seeds import streams
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Specimen:
    """A flawed part with both solids ready for casting and its paths ready to be drawn."""

    flawed: FlawedPart
    scenes: tuple[Scene, Scene]
    aimer: Aimer
    laser: Laser


def load_entry(entry: PartEntry, path: Path | None, name: str) -> Part:
    """Build or read the part of a recipe's entry.

    Raises
    ------
    PartError
        Where it can't be made a closed solid.
    """
    if entry.builtin is not None:
        part = parts.build(entry.builtin, entry.facet_um, **entry.parameters)
    else:
        assert path is not None
        part = load_part(path, unit=entry.unit, thicken_mm=entry.thicken_mm)
    return Part(
        name=name,
        vertices_mm=part.vertices_mm,
        faces=part.faces,
        regions=part.regions,
        mended=part.mended,
        source=part.source,
    )


def check_plan(recipe: Recipe, entry: PartEntry, part: Part) -> None:
    """Check that a part has the regions that its flaws name.

    Raises
    ------
    PartError
        Where it hasn't.
    """
    try:
        recipe.flaws_of(entry).check_regions(part.regions)
    except ValueError as error:
        raise PartError(part.name, f"flaws.{error}", "name a region that it has") from None


def store_part(part: Part, folder: Path) -> str:
    """Store a part in `folder`; return the file's name, which is its checksum."""
    regions = list(part.regions)
    buffer = io.BytesIO()
    np.savez(
        buffer,
        allow_pickle=False,
        vertices_mm=part.vertices_mm,
        faces=part.faces,
        regions=np.array([part.regions[key] for key in regions], dtype=bool).reshape(
            len(regions), len(part.faces)
        ),
        text=np.array(
            json.dumps(
                {
                    "name": part.name,
                    "regions": regions,
                    "mended": part.mended,
                    "source": part.source,
                }
            )
        ),
    )
    data = buffer.getvalue()
    name = f"{hashlib.sha256(data).hexdigest()[:32]}.npz"
    aside = folder / f".{uuid.uuid4().hex}"
    aside.write_bytes(data)
    os.replace(aside, folder / name)
    return name


@lru_cache(maxsize=4)
def stored_part(path: Path) -> tuple[Part, Scene]:
    """Read a stored part and its scene."""
    with np.load(path, allow_pickle=False) as kept:
        text = json.loads(str(kept["text"]))
        part = Part(
            name=text["name"],
            vertices_mm=kept["vertices_mm"],
            faces=kept["faces"],
            regions=dict(zip(text["regions"], kept["regions"], strict=True)),
            mended=tuple(text["mended"]),
            source=text["source"],
        )
    return part, Scene(part.vertices_mm, part.faces)


@lru_cache(maxsize=4)
def skin_of(path: Path) -> Surface:
    """Return the skin of a stored part that flaws follow: for who cuts, others do without."""
    part, _ = stored_part(path)
    return Surface.of(part.vertices_mm, part.faces)


# planned once for a part in each process: the next specimens of the part take the same passes
_PASSES: dict[tuple[Path, str, float], tuple[Pass, ...]] = {}


def _passes(recipe: Recipe, stored: Path, cover: float) -> tuple[Pass, ...]:
    key = (stored, repr(recipe.datasheet), cover)
    if key not in _PASSES:
        part, scene = stored_part(stored)
        _PASSES.clear()
        _PASSES[key] = planned_passes(part, scene, recipe.datasheet, cover)
    return _PASSES[key]


def make_specimen(
    recipe: Recipe, planned: PlannedPart, number: int, folder: Path, *, shared: bool = False
) -> Specimen:
    """Draw the flaws of specimen `number`, cut them and prepare it for scanning.

    The first worker cuts a specimen that is `shared` among workers.
    """
    file = recipe.file
    part, clean_scene = stored_part(folder / planned.stored)
    motion = recipe.motion_of(planned.entry)
    passes: tuple[Pass, ...] = ()
    if motion.cover is not None:
        passes = _passes(recipe, folder / planned.stored, motion.cover)
    outlook = Outlook(part, clean_scene, motion, recipe.datasheet, file.profiles, passes)

    def cut() -> FlawedPart:
        flawed = inject(
            part,
            recipe.flaws_of(planned.entry, number),
            visible_faces=outlook.facing,
            visible_at=outlook.free,
            surface=skin_of(folder / planned.stored),
            rng_of=streams(file.seed, part.name, number, "flaws"),
        )
        # What only carving needs would be kept, and sent to other processes, for nothing.
        return replace(
            flawed, cutters=tuple(replace(cutter, seam=None) for cutter in flawed.cutters)
        )

    if shared:
        kept = (folder / planned.stored).with_name(f"{part.name}-{number}.flawed")
        flawed = replace(cut_once(kept, cut, lambda: clean_scene.tree), part=part)
    else:
        flawed = cut()
    scene = Scene(flawed.vertices_mm, flawed.faces) if flawed.flaws else clean_scene
    laser = Laser.from_datasheet(recipe.datasheet, points=recipe.points)
    aimer = Aimer(
        flawed=flawed,
        outlook=outlook,
        scene=clean_scene,
        motion=motion,
        datasheet=recipe.datasheet,
        laser=laser,
        profiles=file.profiles,
    )
    return Specimen(flawed=flawed, scenes=(scene, clean_scene), aimer=aimer, laser=laser)
