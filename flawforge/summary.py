"""Summary of a dataset, made or predicted: contents and shortfalls."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

MOST_LINES: Final = 10  # of a kind
COUNTS: Final = ("seen", "visible", "detectable")


def summary(dataset: Mapping[str, Any], out: Path | str, *, seconds: float | None = None) -> str:
    """Return the summary of a dataset.

    Parameters
    ----------
    dataset
        Content of dataset.json.
    out
        Folder of the dataset, or its place in an object store.
    seconds
        Duration of the run.
    """
    statistics = dataset["statistics"]
    took = "" if seconds is None else f", {duration(seconds)}"
    lines = [
        f"{_many(dataset['scans'], 'scan')} in {_many(len(dataset['shards']), 'shard')} in {out}"
        + took,
        "splits (by "
        + dataset["split_by"]
        + "): "
        + ", ".join(f"{name} {count}" for name, count in statistics["scans_by_split"].items()),
        *table(statistics["by_split"]),
    ]
    lines += [
        f"mended: {part['part']}: " + "; ".join(part["mended"])
        for part in dataset["parts"]
        if part["mended"]
    ]
    dropped = dataset["flaws_dropped"]
    lines += first(
        [f"no place for a flaw: {one['specimen']}: {one['why']}" for one in dropped],
        "'flaws_dropped' in dataset.json",
    )
    lines += first(
        [
            f"failed: {one.get('scan') or one.get('specimen') or one['part']}: "
            + one["why"].removeprefix(f"{one['part']}: ")
            for one in dataset["failed"]
        ],
        "'failed' in dataset.json",
    )
    lines += first([f"warning: {text}" for text in dataset["warnings"]], "'warnings' there")
    return "\n".join(lines)


def table(by_split: Mapping[str, Mapping[str, Mapping[str, int]]]) -> list[str]:
    """Lay out the flaws of each class by split: in how many scans seen, visible, detectable."""
    kinds = sorted({kind for classes in by_split.values() for kind in classes})
    if not kinds:
        return []
    wide = max(len(kind) for kind in (*kinds, "class"))
    head = [f"{'':{wide}}", *(f"{split:^24}" for split in by_split)]
    under = [f"{'class':{wide}}", *("  seen visible detectable" for _ in by_split)]
    rows = [" ".join(head), " ".join(under)]
    for kind in kinds:
        cells = [
            "".join(
                f"{classes.get(kind, {}).get(count, 0):>{width}}"
                for count, width in zip(COUNTS, (6, 8, 11), strict=True)
            )
            for classes in by_split.values()
        ]
        rows.append(" ".join([f"{kind:{wide}}", *cells]))
    return [row.rstrip() for row in rows]


def duration(seconds: float) -> str:
    """Return a duration with a suitable unit."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    if seconds < 7200:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"


def size(count: float) -> str:
    """Return a number of bytes with a suitable unit."""
    for unit in ("B", "kB", "MB", "GB"):
        if count < 1000:
            return f"{count:.3g} {unit}"
        count /= 1000
    return f"{count:.3g} TB"


def first(lines: list[str], where: str) -> list[str]:
    """Return the first lines of many, and the place of the others."""
    if len(lines) <= MOST_LINES:
        return lines
    return [*lines[:MOST_LINES], f"... and {len(lines) - MOST_LINES} more, see {where}"]


def _many(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
