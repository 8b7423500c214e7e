"""Paths in a recipe: files and globs below the folders that it may read from."""

import glob
from pathlib import Path

from files.errors import RecipeError


def resolve(name: str, roots: tuple[Path, ...], where: str) -> Path:
    """Resolve a path or glob of the recipe inside one of `roots`.

    Raises
    ------
    RecipeError
        Where it leads outside all of them.
    """
    if "\0" in name:
        raise RecipeError("isn't a path", where=where, value=name)
    inside = [root / name for root in roots if _is_below(root / name, root)]
    if not inside and Path(name).is_absolute():
        inside = [Path(name) for root in roots if _is_below(Path(name), root)]
    if not inside:
        raise RecipeError(
            "the path leads outside the recipe's folder",
            where=where,
            value=name,
            allowed="paths below " + " or ".join(str(root) for root in roots)
            + "; name further folders with --parts",
        )
    return next((path for path in inside if _matches(path)), inside[0])


def _is_below(path: Path, root: Path) -> bool:
    return path.resolve().is_relative_to(root)


def _matches(path: Path) -> bool:
    return bool(glob.glob(str(path), recursive=True))
