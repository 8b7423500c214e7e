"""The batch: parts are prepared, shards are made in parallel, the manifest is written last.

A shard is a unit of work: it depends on the recipe and the plan
alone, so the bytes are the same for any number of workers and after any restart.
"""

import hashlib
import json
import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from files.budget import regular
from files.errors import RecipeError
from pipeline.batch.backend import Backend
from pipeline.batch.plan import Plan, PlannedPart, in_turns, make_plan
from pipeline.batch.work import Workplace, is_whole, load_shared, make_shard, read_journal
from pipeline.dataset.checksums import NAME as CHECKSUMS
from pipeline.dataset.checksums import write_checksums
from pipeline.dataset.compression import reader_needs
from pipeline.dataset.description import describe
from pipeline.dataset.folder import drop_leftovers, drop_parts, held
from pipeline.dataset.manifest import versions, write_manifest
from pipeline.dataset.object_store import claim, publish
from pipeline.dataset.shards import file_sha256
from pipeline.injection.specimen import check_plan, load_entry, store_part
from pipeline.parts.part import find_parts
from pipeline.parts.part_error import PartError
from pipeline.recipe import PartEntry, Recipe
from pipeline.recipe_paths import resolve

__all__ = ["Backend", "generate"]

LOG = logging.getLogger("flawforge.generate")
MANY_FLAWS: Final = 100  # in a specimen, from which cutting them takes minutes
MANY_SCANS: Final = 100_000  # from which their plan alone takes some seconds, the scans hours


@dataclass(frozen=True, kw_only=True, slots=True)
class Wanted:
    """A part that the recipe names, not loaded yet."""

    name: str
    entry: PartEntry
    path: Path | None


def generate(
    recipe: Recipe,
    out: Path,
    *,
    backend: Backend | None = None,
    store: Path | None = None,
) -> dict[str, Any]:
    """Make the dataset of a recipe in the folder `out`; return the content of dataset.json.

    With a `store` the dataset goes there, and `out` holds what is in the making. Whole shards of
    an earlier run are kept. Progress goes to the logger "flawforge.generate":
    records have an `event` ("plan", "part", "warning", "shard", "done") and its `facts`.

    Raises
    ------
    RecipeError
        Where the folder is in use or holds something else.
    PartError
        Where not one part can be used.
    """
    backend = backend or Backend()
    recipe = recipe.ready()
    needed = reader_needs(recipe.file.compression)
    used, made_by = recipe.as_used(), versions([needed] if needed else [])
    wanted, failed = find_wanted(recipe)
    identity = {"recipe": used, "versions": made_by, "files": _checksums(recipe, wanted)}
    fingerprint = hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()
    out = out.absolute()
    with backend.chosen(made_by) as client, held(out, fingerprint) as hidden:
        if client is not None:
            from pipeline.batch.cluster import check_folder

            check_folder(client, hidden)
        if store is not None:
            claim(store, hidden)
        parts, facts, failed_parts = prepare(recipe, wanted, hidden / "parts", backend)
        failed += failed_parts
        if not parts:
            raise no_part(recipe, wanted, failed)
        _warn_of_many(recipe, parts)
        plan = make_plan(recipe, parts)
        _log("plan", {"scans": plan.scans, "shards": len(plan.shards), "parts": len(parts)})
        attributes = {"name": recipe.file.name, "recipe": used, "versions": made_by}
        place = Workplace(recipe=recipe, out=out, attributes=attributes, store=store)
        _make_shards(place, plan, {one["part"]: one["triangles"] for one in facts}, backend)
        dataset = write_manifest(
            out,
            journals=(read_journal(place, shard.name) for shard in plan.shards),
            facts={
                "name": recipe.file.name,
                "seed": recipe.file.seed,
                "split_by": plan.split_by,
                "parts": facts,
                "recipe": used,
                "versions": made_by,
                "files": identity["files"],
                "checksums": CHECKSUMS,
                "reader_needs": needed,
                "failed": failed,
            },
        )
        drop_parts(hidden / "parts")
        drop_leftovers(out)
        describe(out, dataset)
        write_checksums(out, {name: facts["sha256"] for name, facts in dataset["shards"].items()})
        if store is not None:
            publish(store, out)
        _log("done", {"scans": dataset["scans"], "failed": len(dataset["failed"])})
        return dataset


def _log(event: str, facts: Mapping[str, Any]) -> None:
    LOG.info("%s %s", event, facts, extra={"event": event, "facts": facts})


def _warn_of_many(recipe: Recipe, parts: Sequence[PlannedPart]) -> None:
    """Say before the night is spent that the recipe asks for very many flaws or scans."""
    flaws = max(recipe.flaws_of(part.entry).most() for part in parts)
    scans = sum(
        recipe.specimens_of(part.entry) * (part.entry.scans or recipe.file.scans) for part in parts
    )
    for count, many, words in (
        (flaws, MANY_FLAWS, "flaws in a specimen, cut one by one"), (scans, MANY_SCANS, "scans"),
    ):  # fmt: skip
        if count > many:
            _log("warning", {"text": f"up to {count} {words}: flawforge check predicts the time"})


def find_wanted(recipe: Recipe) -> tuple[list[Wanted], list[dict[str, str]]]:
    """List every part of the recipe under a unique name, and the missing ones."""
    wanted: list[Wanted] = []
    failed: list[dict[str, str]] = []
    taken: set[str] = set()
    for index, entry in enumerate(recipe.file.parts):
        if entry.builtin is not None:
            found: list[tuple[str, Path | None]] = [(entry.builtin, None)]
        else:
            where = recipe.document.where(("parts", index, "path"))
            place = resolve(str(entry.path), recipe.roots, where)
            try:
                paths = find_parts(place)
            except PartError as error:
                why = f"{error.wrong}; mend: {error.mend}"
                failed.append({"part": str(entry.path), "why": why})
                continue
            found = [(path.stem, path) for path in paths]
        for stem, path in found:
            wish = entry.name or stem
            if entry.name and len(found) > 1:
                wish = f"{entry.name}-{stem}"
            name = _free_name(wish, taken)
            taken.add(name)
            wanted.append(Wanted(name=name, entry=entry, path=path))
    return wanted, failed


def _free_name(wish: str, taken: set[str]) -> str:
    clean = "".join(c if c.isalnum() and c.isascii() or c in "._-" else "_" for c in wish) or "part"
    name, number = clean, 2
    while name in taken:
        name, number = f"{clean}-{number}", number + 1
    return name


def _checksums(recipe: Recipe, wanted: list[Wanted]) -> dict[str, str | None]:
    """SHA-256 of every file that the dataset is made from, by what it is for."""
    files = {want.name: want.path for want in wanted if want.path is not None}
    if recipe.reflectance is not None and recipe.reflectance.picture is not None:
        files["reflectance"] = Path(recipe.reflectance.picture.path)
    for want in wanted:
        poses = recipe.motion_of(want.entry).path
        if isinstance(poses, str):
            files[f"{want.name} motion"] = Path(poses)
    sums: dict[str, str | None] = {}
    for name, path in files.items():
        try:
            regular(path)  # a pipe would be waited for
            sums[name] = file_sha256(path)
        except (OSError, RecipeError):
            sums[name] = None
    for folder, bank in recipe.banks.items():
        sums |= {f"{folder.rstrip('/')}/{name}": one for name, one in bank.checksums.items()}
    return sums


def prepare(
    recipe: Recipe, wanted: list[Wanted], folder: Path, backend: Backend
) -> tuple[list[PlannedPart], list[dict[str, Any]], list[dict[str, str]]]:
    """Load, mend and store every part, in parallel; a failure does not stop the others."""
    drop_parts(folder)
    folder.mkdir()
    results: dict[str, tuple[str | None, dict[str, Any]]] = {}
    for name, stored, facts in backend.results(
        _prepare_one, [(recipe, want, folder) for want in wanted]
    ):
        results[name] = stored, facts
        _log("part", facts)
    planned, facts_kept, failed = [], [], []
    for want in wanted:
        stored, facts = results[want.name]
        if stored is None:
            failed.append({"part": want.name, "why": facts["why"]})
            continue
        planned.append(
            PlannedPart(name=want.name, entry=want.entry, stored=f"parts/{stored}")
        )
        facts_kept.append(facts)
    return planned, facts_kept, failed


def no_part(
    recipe: Recipe, wanted: Sequence[Wanted], failed: Sequence[Mapping[str, str]]
) -> PartError:
    """Return the error of a recipe none of whose parts can be used: the first one's."""
    name, why = failed[0]["part"], failed[0]["why"]
    found = next((want.entry for want in wanted if want.name == name), None)
    index = next(
        k for k, entry in enumerate(recipe.file.parts) if entry is found or str(entry.path) == name
    )
    wrong, _, mend = why.partition("; mend: ")
    where = recipe.document.where(("parts", index))
    return PartError(where, f"no part can be used: {wrong}", mend)


def _prepare_one(
    recipe: Recipe, want: Wanted, folder: Path
) -> tuple[str, str | None, dict[str, Any]]:
    facts: dict[str, Any] = {"part": want.name}
    try:
        part = load_entry(want.entry, want.path, want.name)
        if want.path is not None:
            part = replace(part, source=want.path.name)
        check_plan(recipe, want.entry, part)
        facts |= {
            "triangles": len(part.faces),
            "volume_mm3": part.volume_mm3,
            "bounds_mm": part.bounds_mm.tolist(),
            "source": part.source,
            "mended": list(part.mended),
        }
        return want.name, store_part(part, folder), facts
    except PartError as error:
        # without the folder, which is another on each machine
        why = f"{Path(error.source).name}: {error.wrong}; mend: {error.mend}"
        return want.name, None, facts | {"why": why}


def _make_shards(
    place: Workplace, plan: Plan, triangles: Mapping[str, int], backend: Backend
) -> None:
    """Make the missing shards, in an order that lets no process wait for another."""
    todo = []
    for shard in plan.shards:
        if is_whole(place, shard.name):
            _log("shard", {"shard": shard.name, "scans": shard.scans, "kept": True})
        else:
            todo.append(shard)
    cost = {
        shard.name: sum(triangles[work.part.name] * (work.last - work.first) for work in shard.work)
        for shard in todo
    }
    todo = in_turns(todo, cost)
    if backend.forks(len(todo)):
        load_shared(place, todo)
    for name, scans in backend.results(make_shard, [(place, shard) for shard in todo]):
        _log("shard", {"shard": name, "scans": scans, "kept": False})
