"""Source of a recipe: a file, a built-in recipe, or a mapping; with overrides."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any, Final

from files.errors import RecipeError, known
from files.yaml_document import Document, load_yaml, parse_text

SECTIONS: Final = ("flaws", "motion")  # taken over key by key; everything else as a whole
MOST_BASES: Final = 10


def read_source(
    source: str | Path | Mapping[str, Any], sets: Sequence[str] = (), seed: int | None = None
) -> tuple[Document, tuple[Path, ...]]:
    """Return a recipe's plain data, and the folders that it may read from.

    Parameters
    ----------
    source
        A YAML file, the name of a recipe that flawforge brings, or a mapping (read in the
        working folder).
    sets
        Values in place of the recipe's, as ``motion.yaw_deg=5``.
    seed
        In place of the recipe's.

    Raises
    ------
    RecipeError
        Where a file can't be read, or an override isn't one.
    """
    if isinstance(source, Mapping):
        document = Document(path=Path("recipe"), data=dict(source), lines={})
        folders: tuple[Path, ...] = (Path.cwd(),)
    else:
        path = recipe_path(source)
        document, folders = load_yaml(path), (path.resolve().parent,)
    document, folders = _extended(document, folders)
    changes = [*sets, *([f"seed={seed}"] if seed is not None else [])]
    for change in changes:
        document = _changed(document, change)
    return document, folders


def recipe_path(source: str | Path, *, else_a: str = "") -> Path:
    """Return the file of a recipe: a path, or the name of a built-in recipe.

    A folder of a built-in recipe's name hides no recipe: it may be the dataset made of it.

    Parameters
    ----------
    else_a
        What the caller takes instead of a recipe, for the message: "a dataset's folder, ".
    """
    path = Path(source)
    if path.suffix in (".yaml", ".yml") or path.is_file():
        return path
    names = built_in_recipes()
    if str(source) in names:
        return names[str(source)]
    if path.exists():
        return path  # its reader says what is wrong with it
    raise RecipeError(
        "no such recipe",
        value=str(source),
        **known(str(source), sorted(names), more=f"{else_a}a .yaml file or one of "),
    )


def built_in_recipes() -> dict[str, Path]:
    """Return the recipes that flawforge brings: name to file."""
    brought = resources.files("pipeline") / "recipes"
    return {Path(str(p)).stem: Path(str(p)) for p in brought.iterdir() if p.name.endswith(".yaml")}


def _extended(
    document: Document, folders: tuple[Path, ...]
) -> tuple[Document, tuple[Path, ...]]:
    """Put what a recipe extends below it; the file of its own folder, or a recipe brought."""
    for _ in range(MOST_BASES):
        if "extends" not in document.data:
            return document, folders
        where = document.where(("extends",))
        name = document.data["extends"]
        if not isinstance(name, str):
            raise RecipeError(
                "'extends' has a wrong value", where=where, value=name, allowed="a text"
            )
        path = Path(name)
        if path.suffix in (".yaml", ".yml"):
            path = folders[-1] / path
            if not path.resolve().is_relative_to(folders[0]):
                raise RecipeError(
                    "the path leads outside the recipe's folder", where=where, value=name,
                    allowed=f"paths below {folders[0]}",
                )  # fmt: skip
        base = load_yaml(recipe_path(path))
        folders = (*folders, base.path.resolve().parent)
        document = _merged(base, document)
    raise RecipeError(f"more than {MOST_BASES} recipes extend each other", where=document.path)


def _merged(base: Document, top: Document) -> Document:
    own = {key: value for key, value in top.data.items() if key != "extends"}
    data = {**base.data, **own}
    for section in SECTIONS:
        below, above = base.data.get(section), own.get(section)
        if isinstance(below, Mapping) and isinstance(above, Mapping):
            data[section] = {**below, **above}
    places = {path: f"{base.path}:{line}" for path, line in base.lines.items()}
    return replace(top, data=data, places={**places, **base.places, **top.places})


def _changed(document: Document, change: str) -> Document:
    """Set one value by its dotted key."""
    key, equals, text = change.partition("=")
    path = tuple(int(word) if word.isdecimal() else word for word in key.strip().split("."))
    if not equals or "" in path:
        raise RecipeError("isn't an override", where="--set", value=change, allowed="KEY=VALUE")
    where = f"--set {key}"
    # a level that this makes, or a value of one key that this adds another to, is of this origin
    levels = [path[:n] for n in range(1, len(path)) if _makes(document.data, path, n)]
    data = _with(document.data, path, parse_text(text, where=where), where)
    lines = {at: line for at, line in document.lines.items() if at[: len(path)] != path}
    lines = {at: line for at, line in lines.items() if at not in levels}
    places = {**document.places, **dict.fromkeys([*levels, path], where)}
    return replace(document, data=data, lines=lines, places=places)


def _makes(data: Any, path: tuple[str | int, ...], level: int) -> bool:
    """Whether setting `path` makes what stands at its first `level` keys another value."""
    for key in path[:level]:
        data = _below(data, key)
    return data is None or (
        isinstance(data, Mapping) and len(data) == 1 and str(path[level]) not in data
    )


def _below(data: Any, key: str | int) -> Any:
    """Return what stands at a key of plain data; None where nothing does."""
    if isinstance(data, Mapping):
        return data.get(str(key))
    if isinstance(data, Sequence) and isinstance(key, int) and key < len(data):
        return data[key]
    return None


def _with(data: Any, path: tuple[str | int, ...], value: Any, where: str) -> Any:
    """Return a copy of plain data with one value set; mappings on the way are made."""
    if not path:
        return value
    head, rest = path[0], path[1:]
    if isinstance(data, Sequence) and not isinstance(data, str):
        if not isinstance(head, int) or head >= len(data):
            raise RecipeError(
                "no such entry", where=where, value=head, allowed=f"0 to {len(data) - 1}"
            )
        return [_with(v, rest, value, where) if k == head else v for k, v in enumerate(data)]
    if data is not None and not isinstance(data, Mapping):
        raise RecipeError("has no keys below it", where=where, value=data)
    known = dict(data or {})
    known[str(head)] = _with(known.get(str(head)), rest, value, where)
    return known
