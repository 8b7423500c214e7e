"""Seals: what a case hides, committed by SHA-256(nonce ‖ key) before anything is diagnosed."""

import hashlib
import json
import os
import secrets
from dataclasses import asdict
from pathlib import Path
from typing import Any

from challenge.cases.case import SWITCHES, Secret
from challenge.cases.parts import SHAPES
from challenge.cases.seeds import child
from challenge.cases.switches import DECOY, SINGLE, UNKNOWN
from challenge.second.switches import FAULTS
from challenge.second.switches import SINGLE as SECOND
from challenge.second.switches import UNKNOWN as SECOND_UNKNOWN

# Cases of a full set and of the five-minute subset, by kind.
FULL = {"null": 60, "one": 60, "two": 12, "unknown": 12, "decoy": 8, "undecidable": 8}
SMALL = {"null": 4, "one": 4, "two": 1, "unknown": 1, "decoy": 1, "undecidable": 1}

# Frozen before a run: the aims, and what counts as what.
PROTOCOL: dict[str, Any] = {
    "version": 5,
    "false_alarms_of_60": 1,
    "top_1_medium_and_above": 0.8,
    "precision_medium_and_above": 0.9,
    "unknown_flagged": 0.8,
    "iou": 0.5,
    "recovered_share_of_oracle_gain": 0.7,
    "alarm": "verdict other than match on a null",
    "rival": "counts a half in precision; reported only as alternative counts a half in recall",
    "null": "over 100 speckle draws off edges: block means within 0.1 sigma of what the maker's "
    "file says, at most 0.5 % of points return against it",
    "null_at_edges": "mean departure of a point's mean from the file at most 1.0 sigma (each at "
    "most 10), at most 5 % of points return against it; every key holds what was found",
    "concealed": "KS <= 0.05 and five roughness figures within 10 % off edges, noise fitted",
    "region": "5 x 5 means of on - off beyond 0.3 sigma, or 20 % lost, in patches of 25 points; "
    "offset, tilts and shifts, which a registration takes up, removed, shifts where slopes tell "
    "them; off is scanned where the middle of the exposures is; none for what changes the noise or "
    "is absorbed by the pose, nor beside pixel locking, which on and off both have",
    "gain": "ln of the RMS ratio, each reading at most 10 sigma, where the maker's file describes "
    "the instrument without the effect to 2 sigma; the same points for oracle and answer",
    "shuffled": "blocks of 16 x 16 residuals permuted within each recording, times exchanged",
}

# One recording cannot tell these apart; the right answer is the set.
UNDECIDABLE: dict[str, tuple[str, ...]] = {
    "line_bow": ("line_bow", "form_error"),
    "warped_part": ("line_bow", "form_error"),
    "motion_blur": ("motion_blur", "finite_spot"),
    "lens_distortion": ("lens_distortion", "form_error"),
}


def draw(master: int, counts: dict[str, int], family: str = "first") -> list[Secret]:
    """Draw all cases of a set in a shuffled order.

    Raises
    ------
    ValueError
        Where there is no such family.
    """
    if family == "second":
        return _draw_second(master, counts)
    if family != "first":
        raise ValueError(f"family: no such one; value {family!r}; allowed: first, second")
    rng = child(master, "set")
    wanted: list[tuple[str, tuple[str, ...]]] = [("null", ())] * counts["null"]
    names = list(rng.permutation(list(SINGLE)))
    wanted += [("one", (str(names[k % len(names)]),)) for k in range(counts["one"])]
    for _ in range(counts["two"]):
        first, second = rng.choice(list(SINGLE), 2, replace=False)
        while _clash(str(first), str(second)):
            first, second = rng.choice(list(SINGLE), 2, replace=False)
        wanted.append(("two", (str(first), str(second))))
    for kind, group in (("unknown", UNKNOWN), ("decoy", DECOY), ("undecidable", UNDECIDABLE)):
        pool = list(group)
        wanted += [(kind, (pool[k % len(pool)],)) for k in range(counts[kind])]
    cases = []
    for kind, switches in wanted:
        shapes = set(SHAPES)
        for name in switches:
            shapes &= set(SWITCHES[name].shapes or SHAPES)
        cases.append(
            Secret(
                kind=kind,
                switches=switches,
                # what nobody can see cannot be flagged: strangers are medium or strong
                strength=int(rng.choice([1, 2] if kind == "unknown" else [0, 1, 1, 2])),
                shape=str(rng.choice(sorted(shapes))),
                recordings=1 if kind == "undecidable" else 3,
                seed=int(rng.integers(2**62)),
            )
        )
    return [cases[k] for k in rng.permutation(len(cases))]


def _draw_second(master: int, counts: dict[str, int]) -> list[Secret]:
    """Draw a set of the second family: nulls, one fault, two, and faults outside the catalogue."""
    rng = child(master, "second set")
    names, strange = list(SECOND), list(SECOND_UNKNOWN)
    order = [str(n) for n in rng.permutation(names)]
    wanted: list[tuple[str, tuple[str, ...]]] = [("null", ())] * counts["null"]
    wanted += [("one", (order[k % len(order)],)) for k in range(counts["one"])]
    while sum(kind == "two" for kind, _ in wanted) < counts["two"]:
        pair = tuple(str(n) for n in rng.choice(names, 2, replace=False))
        shapes = set(SHAPES)
        for name in pair:
            shapes &= set(SECOND[name].shapes or SHAPES)
        if shapes and not set(SECOND[pair[0]].accept) & set(SECOND[pair[1]].accept):
            wanted.append(("two", pair))
    wanted += [("unknown", (strange[k % len(strange)],)) for k in range(counts["unknown"])]
    cases = []
    for kind, switches in wanted:
        shapes = set(SHAPES)
        for name in switches:
            shapes &= set(FAULTS[name].shapes or SHAPES)
        strength = int(rng.choice([1, 2] if kind == "unknown" else [0, 1, 1, 2]))
        shape, seed = str(rng.choice(sorted(shapes))), int(rng.integers(2**62))
        cases.append(
            Secret(kind=kind, switches=switches, strength=strength, shape=shape, recordings=3,
                   seed=seed, family="second")
        )  # fmt: skip
    return [cases[k] for k in rng.permutation(len(cases))]


def _clash(first: str, second: str) -> bool:
    """Two switches that turn the same screw, or share no part."""
    same = [
        {"anisotropic_lay", "roughness_level"},
        {"line_bow", "lens_distortion", "column_offset", "range_scale"},
        {"finite_spot", "motion_blur", "pixel_locking"},
        {"specular_dropout", "interreflection", "reflectance_edge", "volume_scattering"},
    ]
    shapes = set(SWITCHES[first].shapes or SHAPES) & set(SWITCHES[second].shapes or SHAPES)
    return not shapes or any({first, second} <= group for group in same)


def entropy() -> int:
    """Return a master seed from the operating system."""
    return secrets.randbits(62)


def seal(secret: Secret, facts: dict[str, Any]) -> tuple[bytes, str, str]:
    """Serialise a key and commit to it.

    Returns
    -------
    key : bytes
        JSON, as the judge will read it.
    nonce : str
        Hexadecimal, kept with the key.
    commitment : str
        SHA-256 of nonce bytes followed by the key's bytes.
    """
    key = json.dumps({"secret": asdict(secret), "facts": facts}, sort_keys=True).encode()
    nonce = secrets.token_hex(32)
    return key, nonce, commitment(nonce, key)


def commitment(nonce: str, key: bytes) -> str:
    """SHA-256(nonce ‖ key) in hexadecimal."""
    return hashlib.sha256(bytes.fromhex(nonce) + key).hexdigest()


def write_whole(file: Path, data: bytes) -> None:
    """Write a file aside, sync it, and rename it into place."""
    aside = file.with_name(f".{file.name}.{os.getpid()}")
    with aside.open("wb") as out:
        out.write(data)
        out.flush()
        os.fsync(out.fileno())
    aside.replace(file)
