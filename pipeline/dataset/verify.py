"""Whether a dataset is whole, and whether a rebuild is the dataset that was released."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from pipeline.dataset.folder import write_whole
from pipeline.dataset.manifest import SCAN_COLUMNS
from pipeline.dataset.shards import file_sha256, scan_checksums
from sensors.typed_yaml import RecipeError

LOCK_FORMAT: Final = "flawforge-lock"
MADE_BY: Final = "a file made by verify --write"
# A rebuild with other versions may differ by this much in each shard's figures.
SHARE_TOLERANCE, DEPTH_TOLERANCE_MM, PIXEL_TOLERANCE = 1e-3, 1e-3, 0.01


@dataclass(frozen=True, kw_only=True, slots=True)
class Report:
    """What a check found: lines to read, and how many of them are faults."""

    lines: tuple[str, ...]
    wrong: int


def read_dataset(folder: Path) -> dict[str, Any]:
    """Return what dataset.json says.

    Raises
    ------
    RecipeError
        Where the folder holds no finished dataset.
    """
    path = folder / "dataset.json"
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
    return said


def verify(folder: Path) -> Report:
    """Check every shard's checksum, every scan's own, and the manifest's rows against them."""
    import pandas as pd

    said = read_dataset(folder)
    wrong: list[str] = []
    stored: dict[str, str] = {}
    for name, facts in said["shards"].items():
        path = folder / name
        if not path.is_file():
            wrong.append(f"{name}: missing")
            continue
        if file_sha256(path) != facts["sha256"]:
            wrong.append(f"{name}: damaged, its checksum isn't the one in dataset.json")
            continue
        stored.update(scan_checksums(path))
    found = sorted(path.name for path in folder.glob("shard-*.h5"))
    wrong += [f"{name}: not part of this dataset" for name in found if name not in said["shards"]]
    for end in ("parquet", "csv"):
        table_path = folder / f"manifest.{end}"
        try:
            table = pd.read_parquet(table_path) if end == "parquet" else pd.read_csv(table_path)
        except (OSError, ValueError) as error:
            wrong.append(f"{table_path.name}: can't be read ({' '.join(str(error).split())})")
            continue
        missing = set(SCAN_COLUMNS) - set(table.columns)
        if missing:
            wrong.append(f"{table_path.name}: columns missing: {', '.join(sorted(missing))}")
            continue
        listed = dict(zip(table["scan_id"], table["checksum"], strict=True))
        if len(table) != said["scans"]:
            wrong.append(f"{table_path.name}: {len(table)} rows for {said['scans']} scans")
        for scan_id, checksum in stored.items():
            if listed.get(scan_id) != checksum:
                wrong.append(f"{table_path.name}: scan {scan_id} isn't listed as it is stored")
    if wrong:
        return Report(lines=(*wrong, f"{folder}: {len(wrong)} faults"), wrong=len(wrong))
    line = f"{folder}: {said['scans']} scans in {len(said['shards'])} shards, all whole"
    return Report(lines=(line,), wrong=0)


def write_lock(folder: Path, lock: Path) -> None:
    """Write the lock of a released dataset."""
    said = read_dataset(folder)
    kept = {
        "format": LOCK_FORMAT,
        "version": 1,
        **{key: said[key] for key in ("name", "seed", "recipe", "files", "versions", "shards")},
    }
    if lock.is_dir():
        raise RecipeError("is a folder", where=lock, allowed="a file, NAME.lock")
    lock.parent.mkdir(parents=True, exist_ok=True)
    write_whole(lock, json.dumps(kept, indent=1, sort_keys=True) + "\n")


def compare_with_lock(folder: Path, lock: Path) -> Report:
    """Hold a dataset against the lock of a release.

    Raises
    ------
    RecipeError
        Where the lock can't be read or is the lock of another recipe.
    """
    said = read_dataset(folder)
    try:
        kept = json.loads(lock.read_text(encoding="utf-8"))
    except OSError as error:
        raise RecipeError(f"can't be read ({error.strerror})", where=lock) from None
    except ValueError:
        raise RecipeError("isn't a lock", where=lock, allowed=MADE_BY) from None
    if not isinstance(kept, dict) or kept.get("format") != LOCK_FORMAT:
        raise RecipeError("isn't a lock", where=lock, allowed=MADE_BY)
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
    if not unlike:
        return Report(lines=(f"{folder}: the same bytes as {lock}", *others), wrong=0)
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
