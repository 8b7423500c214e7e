"""Check of a dataset, and comparison of a rebuild with a release."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from files.budget import regular
from files.errors import RecipeError
from files.whole_file import write_whole
from pipeline.dataset.checksums import NAME, Checksums, own_files, read_checksums
from pipeline.dataset.manifest import FLAW_COLUMNS, SCAN_COLUMNS
from pipeline.dataset.shards import file_sha256, pixels_in, scan_checksums, scans_in
from pipeline.dataset.tables import is_plain, read_table

LOCK_FORMAT: Final = "flawforge-lock"
MADE_BY: Final = "a file made by verify --write"
# A rebuild with other versions may differ by this much in each shard's figures.
SHARE_TOLERANCE, DEPTH_TOLERANCE_MM, PIXEL_TOLERANCE = 1e-3, 1e-3, 0.01


@dataclass(frozen=True, kw_only=True, slots=True)
class Report:
    """Result of a check: lines, and the number of faults."""

    lines: tuple[str, ...]
    wrong: int


SHARED: Final = {"name": str, "shards": dict, "recipe": dict, "files": dict, "versions": dict}
"""What readers of dataset.json and of locks rely on."""
SHAPE: Final = {**SHARED, "scans": int, "classes": dict}


def read_dataset(folder: Path) -> dict[str, Any]:
    """Return the content of dataset.json.

    Raises
    ------
    RecipeError
        Where the folder holds no finished dataset.
    """
    path = folder / "dataset.json"
    if path.exists():
        regular(path)
    try:
        said = json.loads(path.read_text(encoding="utf-8"))
    except OSError:
        unfinished = (folder / ".flawforge").is_dir()
        raise RecipeError(
            "isn't finished; run the same generate command again"
            if unfinished
            else "no dataset here",
            where=folder,
            allowed="a folder made by flawforge generate",
        ) from None
    except ValueError as error:
        raise RecipeError(f"isn't JSON ({error})", where=path) from None
    if not isinstance(said, dict) or said.get("format") != "flawforge-dataset":
        raise RecipeError("isn't a dataset's description", where=path)
    for key, kind in SHAPE.items():
        if not isinstance(said.get(key), kind):
            raise RecipeError(f"isn't a dataset's description: '{key}' isn't {kind.__name__}",
                              where=path)  # fmt: skip
    for name, facts in said["shards"].items():
        if not (is_plain(name) and isinstance(facts, dict) and "sha256" in facts):
            raise RecipeError("isn't a shard's name with its checksum", where=path, value=name)
    if not all(number.isdecimal() for number in said["classes"]):
        raise RecipeError("'classes' aren't numbers with names", where=path)
    return said


def verify(folder: Path, *, content: bool = False) -> Report:
    """Check every file's checksum and the tables' rows against the shards.

    Parameters
    ----------
    folder
        Of the dataset.
    content
        Decode every scan and hold its arrays and its flaws' pixels against the tables, too; a file
        with other bytes and the same content is then no fault.
    """
    faults: dict[str, list[str]] = {}
    notes: list[str] = []
    try:
        listed = read_checksums(folder)
    except (ValueError, OSError) as error:
        listed = None
        faults[NAME] = [f"damaged: {error}"]
    if listed is not None:
        _check_bytes(folder, listed, faults)
    try:
        said = read_dataset(folder)
    except RecipeError as error:
        if "dataset.json" not in faults:
            raise
        faults["dataset.json"].append(str(error))
        return _report(folder, faults, notes, None)
    if listed is None and said.get("checksums") == NAME and NAME not in faults:
        faults[NAME] = ["missing"]
    elif listed is None and NAME not in faults:  # made before there was such a list
        notes.append(f"{folder}: has no {NAME}; shards and tables are checked by their content")
        _check_shards(folder, said, faults)
    held = _stored(folder, said, faults, content=content or listed is None)
    for stem in ("manifest", "flaws"):
        for end in ("parquet", "csv"):
            _check_table(folder, f"{stem}.{end}", said, held, faults)
    if content:
        _forgive(folder, faults, notes)
    return _report(folder, faults, notes, said)


def _report(
    folder: Path, faults: dict[str, list[str]], notes: list[str], said: dict[str, Any] | None
) -> Report:
    if faults:
        lines = [f"{name}: {'; '.join(words)}" for name, words in sorted(faults.items())]
        return Report(
            lines=(*notes, *lines, f"{folder}: {len(faults)} faults"), wrong=len(faults)
        )
    assert said is not None
    line = f"{folder}: {said['scans']} scans in {len(said['shards'])} shards, all whole"
    return Report(lines=(*notes, line), wrong=0)


def _check_bytes(folder: Path, listed: Checksums, faults: dict[str, list[str]]) -> None:
    """Compare each file with its checksum; name what is missing, damaged, swapped or added."""
    whose = {digest: name for name, digest in listed.files.items()}
    journals = (folder / ".flawforge").is_dir()
    for name, digest in listed.files.items():
        path = folder / name
        if name.startswith(".flawforge/") and not journals:
            continue  # a dataset that was passed on without its journals
        if not path.is_file():
            faults[name] = ["missing"]
            continue
        found = file_sha256(path)
        if found == digest:
            continue
        if found in whose:
            faults[name] = [f"holds what {whose[found]} should hold"]
        else:
            faults[name] = [f"damaged, its checksum isn't the one in {NAME}"]
    for name in own_files(folder):
        if name not in listed.files:
            faults[name] = ["not part of this dataset"]


def _check_shards(folder: Path, said: dict[str, Any], faults: dict[str, list[str]]) -> None:
    """Compare shards with dataset.json alone, for datasets without a list of checksums."""
    for name, facts in said["shards"].items():
        path = folder / name
        if not path.is_file():
            faults[name] = ["missing"]
        elif file_sha256(path) != facts["sha256"]:
            faults[name] = ["damaged, its checksum isn't the one in dataset.json"]
    for path in folder.glob("shard-*.h5"):
        if path.name not in said["shards"]:
            faults[path.name] = ["not part of this dataset"]


@dataclass(frozen=True, kw_only=True, slots=True)
class _Held:
    """What the shards hold: where each scan is, and, decoded, its checksum and flaws' pixels."""

    place: dict[str, tuple[str, int]]
    checksum: dict[str, str]
    pixels: dict[tuple[str, int], int]


def _stored(
    folder: Path, said: dict[str, Any], faults: dict[str, list[str]], *, content: bool
) -> _Held:
    held = _Held(place={}, checksum={}, pixels={})
    for name in said["shards"]:
        if not (folder / name).is_file():
            continue
        if name in faults and not content:
            continue
        try:
            scans = scans_in(folder / name)
            held.place.update({scan: (name, row) for row, scan in enumerate(scans)})
            if content:
                held.checksum.update(scan_checksums(folder / name))
                held.pixels.update(pixels_in(folder / name))
        except (OSError, ValueError, KeyError, RuntimeError) as error:
            words = " ".join(str(error).split())
            faults.setdefault(name, []).append(f"can't be read ({words})")
    return held


def _check_table(
    folder: Path, name: str, said: dict[str, Any], held: _Held, faults: dict[str, list[str]]
) -> None:
    """Hold a table's rows against the shards."""
    path = folder / name
    wanted = SCAN_COLUMNS if name.startswith("manifest") else FLAW_COLUMNS

    def fault(words: str) -> None:
        faults.setdefault(name, []).append(words)

    if not path.is_file():
        if name not in faults:
            fault("missing")
        return
    try:
        table = read_table(path)
    except RecipeError as error:
        fault(str(error).removeprefix(f"{path}: "))
        return
    missing = {"scan_id", "shard", "row", "checksum"} if wanted is SCAN_COLUMNS else {
        "scan_id", "instance", "pixels"
    }  # fmt: skip
    missing -= set(table.columns)
    if missing:
        fault(f"columns missing: {', '.join(sorted(missing))}")
        return
    check = _wrong_flaws if wanted is FLAW_COLUMNS else _wrong_scans
    try:
        words = check(table, said, held)
    except (TypeError, ValueError, OverflowError) as error:  # of another type than was written
        words = [f"rows can't be compared ({' '.join(str(error).split())[:120]})"]
    for one in words:
        fault(one)


def _wrong_flaws(table: Any, said: dict[str, Any], held: _Held) -> list[str]:
    for scan, number, pixels in zip(
        table["scan_id"], table["instance"], table["pixels"], strict=True
    ):
        if scan not in held.place and not _gone(held, said):
            return [f"scan {scan} is in no shard"]
        stored = held.pixels.get((str(scan), int(number)))
        if held.pixels and scan in held.checksum and (stored or 0) != pixels:
            return [f"scan {scan}, instance {number}: {pixels} pixels listed, {stored} stored"]
    return []


def _wrong_scans(table: Any, said: dict[str, Any], held: _Held) -> list[str]:
    wrong = []
    if len(table) != said["scans"]:
        wrong.append(f"{len(table)} rows for {said['scans']} scans")
    listed = dict(zip(table["scan_id"], table["checksum"], strict=True))
    where = dict(
        zip(table["scan_id"], zip(table["shard"], table["row"], strict=True), strict=True)
    )
    for scan_id, (shard, row) in held.place.items():
        stored_as = held.checksum.get(scan_id, listed.get(scan_id))
        if listed.get(scan_id) is None or listed[scan_id] != stored_as or where[scan_id] != (
            shard, row
        ):  # fmt: skip
            return [*wrong, f"scan {scan_id} isn't listed as it is stored"]
    return wrong


def _gone(held: _Held, said: dict[str, Any]) -> bool:
    """Return whether a shard could not be read, so that scans are missing anyway."""
    return len({shard for shard, _ in held.place.values()}) < len(said["shards"])


def _forgive(folder: Path, faults: dict[str, list[str]], notes: list[str]) -> None:
    """Drop faults of files whose bytes alone differ: their content was found right."""
    for name in list(faults):
        alone = len(faults[name]) == 1 and faults[name][0].startswith("damaged, its checksum")
        if not alone or name.startswith(".flawforge"):
            continue
        same = name.startswith("shard-") or _same_table(folder, name)
        if same:
            notes.append(f"{name}: other bytes, the same content")
            del faults[name]


def _same_table(folder: Path, name: str) -> bool:
    """Return whether a table holds the values of its twin in the other form."""
    import pandas as pd

    stem, _, end = name.partition(".")
    if stem not in ("manifest", "flaws") or end not in ("csv", "parquet"):
        return False
    try:
        one = read_table(folder / f"{stem}.csv")
        other = read_table(folder / f"{stem}.parquet")
    except RecipeError:  # a twin that is missing or damaged proves nothing
        return False
    if list(one.columns) != list(other.columns) or len(one) != len(other):
        return False
    for column in one.columns:
        a, b = one[column], other[column]
        if b.dtype.kind in "fiu":
            near = np.isclose(
                pd.to_numeric(a, errors="coerce"), pd.to_numeric(b), rtol=1e-15, atol=0,
                equal_nan=True,
            )  # fmt: skip
            if not near.all():
                return False
        elif not (a.fillna("").astype(str) == b.fillna("").astype(str)).all():
            return False
    return True


def write_lock(folder: Path, lock: Path) -> None:
    """Write the lock of a released dataset."""
    said = read_dataset(folder)
    kept = {
        "format": LOCK_FORMAT,
        "version": 1,
        **{key: said[key] for key in ("name", "seed", "recipe", "files", "versions", "shards")},
    }
    listed = read_checksums(folder)
    if listed is not None:
        kept["root"] = listed.root
    if lock.is_dir():
        raise RecipeError("is a folder", where=lock, allowed="a file, NAME.lock")
    lock.parent.mkdir(parents=True, exist_ok=True)
    write_whole(lock, json.dumps(kept, indent=1, sort_keys=True) + "\n")


def compare_with_lock(folder: Path, lock: Path) -> Report:
    """Compare a dataset with the lock of a release.

    Raises
    ------
    RecipeError
        Where the lock can't be read or is the lock of another recipe.
    """
    said = read_dataset(folder)
    if lock.exists():
        regular(lock)
    try:
        kept = json.loads(lock.read_text(encoding="utf-8"))
    except OSError as error:
        raise RecipeError(f"can't be read ({error.strerror})", where=lock) from None
    except ValueError:
        raise RecipeError("isn't a lock", where=lock, allowed=MADE_BY) from None
    if not isinstance(kept, dict) or kept.get("format") != LOCK_FORMAT:
        raise RecipeError("isn't a lock", where=lock, allowed=MADE_BY)
    if not all(isinstance(kept.get(key), kind) for key, kind in SHARED.items()):
        raise RecipeError("is damaged", where=lock, allowed=MADE_BY)
    for key in ("recipe", "files"):
        if kept[key] != said[key]:
            was, now = kept[key], said[key]
            differ = sorted(k for k in was.keys() | now.keys() if was.get(k) != now.get(k))
            raise RecipeError(
                f"the dataset was made from other {key}: {', '.join(differ)} differ", where=lock
            )
    if set(kept["shards"]) != set(said["shards"]):
        return Report(lines=(f"{folder}: other shards than in {lock}",), wrong=1)
    others = [
        f"{name} {kept['versions'].get(name)} -> {said['versions'].get(name)}"
        for name in sorted(kept["versions"].keys() | said["versions"].keys())
        if kept["versions"].get(name) != said["versions"].get(name)
    ]
    released = kept["shards"]
    unlike = [n for n, facts in said["shards"].items() if released[n]["sha256"] != facts["sha256"]]
    listed = read_checksums(folder)
    same_root = listed is None or kept.get("root") in (None, listed.root)
    if not unlike and (same_root or others):
        return Report(lines=(f"{folder}: the same bytes as {lock}", *others), wrong=0)
    if not unlike:
        line = f"{folder}: the same shards as {lock}, other tables or documents (root checksum)"
        return Report(lines=(line,), wrong=1)
    if not others:
        lines = [f"{name}: other bytes with the same versions" for name in unlike]
        return Report(lines=tuple(lines), wrong=len(lines))
    wrong = [f for name in unlike for f in _beyond(name, released[name], said["shards"][name])]
    lines = [f"versions differ: {', '.join(others)}", f"{len(unlike)} shards with other bytes"]
    lines += wrong or ["all within the tolerance"]
    return Report(lines=tuple(lines), wrong=len(wrong))


def _beyond(name: str, released: dict[str, Any], rebuilt: dict[str, Any]) -> list[str]:
    """Say in which figures a rebuilt shard is off by more than the tolerance."""
    allowed = {
        "scans": 0.0,
        "share_valid": SHARE_TOLERANCE,
        "depth_mean_mm": DEPTH_TOLERANCE_MM,
        "flaw_pixels": PIXEL_TOLERANCE * max(released["flaw_pixels"], 100),
    }
    lines = []
    for key, tolerance in allowed.items():
        was, now = released[key] or 0.0, rebuilt[key] or 0.0
        if abs(was - now) > tolerance:
            lines.append(f"{name}: {key} {was:g} -> {now:g}, allowed +-{tolerance:g}")
    return lines
