"""Seals: what a case hides, committed by SHA-256(nonce ‖ key) before anything is diagnosed."""

import hashlib
import json
import os
import secrets
from dataclasses import asdict
from pathlib import Path
from typing import Any

from challenge.cases.case import Secret
from challenge.sets.aims import AIMS

MESHES = "meshes"
"""Folder of a set that keeps the CAD meshes among its parts."""

# Frozen before a run: the aims, and what counts as what.
PROTOCOL: dict[str, Any] = {
    "version": 6,
    "aims": AIMS,
    "alarm": "verdict other than match on a null",
    "rival": "counts a half in precision; reported only as alternative counts a half in recall",
    "null": "over 100 speckle draws off edges: block means within 0.1 sigma of what the maker's "
    "file says, at most 0.5 % of points return against it",
    "null at edges": "mean departure of a point's mean from the file at most 1.0 sigma (each at "
    "most 10), at most 5 % of points return against it; every key holds what was found",
    "concealed": "KS <= 0.05 and five roughness figures within 10 % off edges, noise fitted",
    "region": "5 x 5 means of on - off beyond 0.3 sigma, or 20 % lost, in patches of 25 points; "
    "offset, tilts and shifts, which a registration takes up, removed, shifts where slopes tell "
    "them; off is scanned where the middle of the exposures is; none for what changes the noise or "
    "is absorbed by the pose, nor beside pixel locking, which on and off both have",
    "null of the second family": "block means off edges depart at most 1.5 times as far as in the "
    "worse of its baseline recordings, plus 0.1 sigma; by less than 0.1 sigma over 12 specimens",
    "size": "a medium or strong fault of the second family that moves readings is doubled, three "
    "times at most, until perfect knowledge tells it from none at 8 sigma",
    "gain": "ln of the RMS ratio, at most the oracle's, each reading at most 10 sigma, where the "
    "maker's file describes the instrument without the effect to 2 sigma; the "
    "same points for oracle and answer",
    "shuffled": "blocks of 16 x 16 residuals permuted within each recording, times exchanged",
}


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


def commitments_of(out: Path) -> dict[str, Any]:
    """Read what was committed to when a set was made.

    Raises
    ------
    ValueError
        Where the folder holds no finished set.
    """
    file = out / "commitments.json"
    if not file.exists():
        raise ValueError(f"{out} has no commitments.json: finish `challenge make` first")
    return dict(json.loads(file.read_text()))


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
