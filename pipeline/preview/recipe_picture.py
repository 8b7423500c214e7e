"""What a recipe would make, drawn before anything is generated: its first specimen and path."""

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from files.errors import RecipeError
from pipeline.batch.plan import PlannedPart
from pipeline.batch.run import find_wanted
from pipeline.injection.specimen import check_plan, load_entry, make_specimen, store_part
from pipeline.parts.part_error import PartError
from pipeline.preview.setup_picture import draw_setup
from pipeline.recipe import Recipe
from pipeline.seeds import streams


def draw_recipe(
    source: str | Path | Mapping[str, Any],
    picture: Path,
    *,
    part: str | None = None,
    roots: tuple[Path, ...] = (),
    sets: Sequence[str] = (),
    seed: int | None = None,
) -> Path:
    """Draw part, flaws, sensor fan and path of a recipe's first specimen as they will be.

    Parameters
    ----------
    source, roots, sets, seed
        The recipe, as `Recipe.load` takes it.
    picture
        PNG to write.
    part
        Name of the part; the first that can be used where left out.

    Raises
    ------
    RecipeError
        For a bad recipe or an unknown part.
    PartError
        Where the part can't be used.
    """
    recipe = Recipe.load(source, roots=roots, sets=sets, seed=seed)
    recipe_path = recipe.document.path
    wanted, failed = find_wanted(recipe)
    names = [want.name for want in wanted]
    if part is not None and part not in names:
        raise RecipeError("no such part", where=recipe_path, value=part, allowed=", ".join(names))
    if not wanted:
        raise PartError(recipe_path, failed[0]["why"], "another path")
    want = wanted[0 if part is None else names.index(part)]
    try:
        solid = load_entry(want.entry, want.path, want.name)
    except PartError as error:
        where = recipe.document.where(("parts", recipe.file.parts.index(want.entry)))
        raise PartError(f"{where}: {error.source}", error.wrong, error.mend) from None
    check_plan(recipe, want.entry, solid)
    with tempfile.TemporaryDirectory() as folder:
        stored = store_part(solid, Path(folder))
        planned = PlannedPart(name=want.name, entry=want.entry, stored=stored)
        specimen = make_specimen(recipe, planned, 0, Path(folder))
    path, _ = specimen.aimer.path(streams(recipe.file.seed, want.name, 0, "scan", 0))
    flawed = specimen.flawed
    return draw_setup(
        picture,
        vertices_mm=flawed.vertices_mm,
        faces=flawed.faces,
        instance=flawed.instance,
        poses=path.poses,
        datasheet=recipe.datasheet,
        title=f"{recipe.file.name}: {want.name}",
        kinds={flaw.instance: flaw.kind for flaw in flawed.flaws},
    )
