"""Shortfalls of a dataset as training data, from its statistics, made or predicted."""

from collections.abc import Iterator, Mapping
from typing import Any, Final

SHARE_OFF: Final = 0.10
"""A split's share of the scans may be off by ten points before a user should know."""

FEW_VALID: Final = 0.25
"""Below a quarter of valid readings, most of a part's scans is not the part."""


def shortfalls(dataset: Mapping[str, Any]) -> list[str]:
    """List the shortfalls, one line each.

    Parameters
    ----------
    dataset
        What dataset.json says: `recipe`, `parts`, `split_by` and `statistics`; the counts may be
        expectations, rounded.
    """
    return [
        *_without_surface(dataset),
        *_without_shadows(dataset["recipe"]["sensor"]),
        *_shares(dataset),
        *_classes(dataset["statistics"]["by_split"]),
        *_parts(dataset["statistics"]["by_part"]),
    ]


def _without_surface(dataset: Mapping[str, Any]) -> Iterator[str]:
    bare = [p for p, facts in dataset["statistics"]["by_part"].items() if facts["surface"] is None]
    if bare:
        yield f"{', '.join(bare)}: no `surface`, simulated without speckle, smooth as a mirror"


def _without_shadows(sensor: Mapping[str, Any]) -> Iterator[str]:
    listed = {effect["name"] for effect in sensor["effects"]}
    if sensor["triangulation_angle_deg"] is None:
        yield (
            f"sensor {sensor['name']}: no triangulation angle stated, walls cast no shadow;"
            " `triangulation_angle_deg` in the recipe states it"
        )
    elif "camera_occlusion" not in listed:
        yield f"sensor {sensor['name']}: effect `camera_occlusion` not listed, walls cast no shadow"


def _shares(dataset: Mapping[str, Any]) -> Iterator[str]:
    counts = dataset["statistics"]["scans_by_split"]
    total = sum(counts.values())
    for split, wanted in dataset["recipe"]["splits"].items():
        got = counts.get(split, 0) / total if total else 0.0
        if abs(got - wanted) > SHARE_OFF:
            yield (
                f"split {split}: {got:.0%} of the scans instead of {wanted:.0%}; the splits are"
                f" made by {dataset['split_by']}, see `split_by`"
            )


def _classes(by_split: Mapping[str, Mapping[str, Mapping[str, int]]]) -> Iterator[str]:
    kinds = sorted({kind for classes in by_split.values() for kind in classes})
    for kind in kinds:
        counts = {split: classes.get(kind, {}) for split, classes in by_split.items()}
        unseen = [split for split, found in counts.items() if not found.get("seen")]
        hidden = [
            split
            for split, found in counts.items()
            if found.get("seen") and not found.get("detectable")
        ]
        if unseen:
            yield f"{kind}: in no scan of {', '.join(unseen)}"
        if hidden:
            yield f"{kind}: detectable in no scan of {', '.join(hidden)}"


def _parts(by_part: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    for part, facts in by_part.items():
        if facts["flaws"] and not facts["detectable"]:
            yield f"part {part}: no detectable flaw in any scan"
        if facts["share_valid"] is not None and facts["share_valid"] < FEW_VALID:
            yield f"part {part}: {facts['share_valid']:.0%} of the points have a reading"
        planned = facts.get("planned_passes")
        if planned and facts["passes_taken"] < planned:
            yield (
                f"part {part}: {facts['passes_taken']} of {planned} planned passes taken; `scans`:"
                f" {planned} of a specimen cover it"
            )
