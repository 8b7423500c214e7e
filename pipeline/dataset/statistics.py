"""Counts of a dataset by class, split and part."""

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any


class Statistics:
    """Running counts over a dataset's scans and flaws."""

    def __init__(self, splits: Iterable[str]) -> None:
        self._splits = dict.fromkeys(splits, 0)
        self._by_class: dict[str, Counter[str]] = {}
        self._by_split: dict[str, dict[str, Counter[str]]] = {split: {} for split in self._splits}
        self._by_part: dict[str, dict[str, Any]] = {}
        self._passes: dict[str, set[int]] = {}
        self._share_valid = 0.0

    @property
    def scans(self) -> int:
        """Number of scans so far."""
        return sum(self._splits.values())

    def add_scan(self, row: Mapping[str, Any]) -> None:
        """Count a row of the manifest."""
        self._splits[row["split"]] += 1
        self._share_valid += row["share_valid"]
        part = self._by_part.setdefault(
            row["part"],
            {"scans": 0, "share_valid": 0.0, "surface": row["surface"], "flaws": 0, "seen": 0,
             "detectable": 0},
        )  # fmt: skip
        part["scans"] += 1
        if row.get("planned_passes"):
            part["planned_passes"] = row["planned_passes"]
            self._passes.setdefault(row["part"], set()).add(row["planned_pass"])
        part["share_valid"] += row["share_valid"]

    def add_flaw(self, row: Mapping[str, Any]) -> None:
        """Count a row of the flaws, of a scan that was added before."""
        kind, seen, detectable = row["kind"], row["pixels"] > 0, row["detectable"]
        for counts in (
            self._by_class.setdefault(kind, Counter()),
            self._by_split[row["split"]].setdefault(kind, Counter()),
        ):
            counts["rows"] += 1
            counts["seen"] += seen
            counts["visible"] += row["pixels_visible"] > 0
            counts["detectable"] += detectable
            counts["pixels"] += row["pixels"]
            counts["pixels_visible"] += row["pixels_visible"]
        part = self._by_part[row["part"]]
        part["flaws"] += 1
        part["seen"] += seen
        part["detectable"] += detectable

    def counted(self) -> dict[str, Any]:
        """Return all counts, plain."""
        return {
            "by_class": {kind: dict(counts) for kind, counts in sorted(self._by_class.items())},
            "by_split": {
                split: {kind: dict(counts) for kind, counts in sorted(classes.items())}
                for split, classes in self._by_split.items()
            },
            "by_part": {
                name: {
                    **part,
                    "share_valid": part["share_valid"] / part["scans"],
                    **({"passes_taken": len(self._passes[name])} if name in self._passes else {}),
                }
                for name, part in self._by_part.items()
            },
            "scans_by_split": dict(self._splits),
            "mean_share_valid": self._share_valid / self.scans if self.scans else None,
        }
