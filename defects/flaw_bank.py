"""A bank of flaws from real scans: reliefs over a part's skin, one file each."""

import hashlib
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

FORMAT, VERSION = "flawforge-relief", 1
FEWEST_NODES = 7
"""Nodes on each side of a lattice: two of margin on both sides of three, for a cubic spline."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Relief:
    """One flaw: height of the surface over the skin, on a square lattice on the skin.

    Parameters
    ----------
    name
        What records call it.
    pitch_mm
        Distance of the nodes along the skin.
    height_mm
        (n, m) along the local normal, below zero in a hollow, and zero beyond the flaw and where
        it fades. Rows run along the flaw, columns to the left of it; the middle node is where it
        sits, so that n and m are odd. Zero within two nodes of the rim.
    mask
        (n, m) nodes that belong to the flaw, without the fade.
    facts
        Where it comes from: recording, pose, pitch and noise, as plain data.

    Raises
    ------
    ValueError
        When the arrays aren't that; one line.
    """

    name: str
    pitch_mm: float
    height_mm: Floats
    mask: Bools
    facts: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        shape = self.height_mm.shape
        if len(shape) != 2 or min(shape) < FEWEST_NODES or not (shape[0] % 2 and shape[1] % 2):
            raise ValueError(f"height_mm is {shape}, not two odd numbers from {FEWEST_NODES} on")
        if self.mask.shape != shape or self.mask.dtype != np.bool_ or not self.mask.any():
            raise ValueError("mask must mark some of height_mm's nodes")
        if self.footprint.sum() != self.footprint[2:-2, 2:-2].sum():
            raise ValueError("the flaw must keep two nodes from the rim")
        if not np.isfinite(self.height_mm).all() or not self.height_mm[self.mask].any():
            raise ValueError("height_mm must be finite, and not zero all over the flaw")
        if not (np.isfinite(self.pitch_mm) and self.pitch_mm > 0):
            raise ValueError(f"pitch_mm is {self.pitch_mm}, must be above 0")

    @property
    def footprint(self) -> Bools:
        """Nodes (n, m) where the surface isn't the skin, fade included."""
        return np.asarray(self.mask | (self.height_mm != 0))

    def dimensions(self) -> dict[str, float]:
        """Return length, width, depth, height (mm), area (mm²) and volumes (mm³) of the flaw."""
        rows, columns = np.nonzero(self.mask)
        inside, low = self.height_mm[self.mask], self.height_mm < 0
        cell = self.pitch_mm**2
        return {
            "length_mm": float(np.ptp(rows) + 1) * self.pitch_mm,
            "width_mm": float(np.ptp(columns) + 1) * self.pitch_mm,
            "depth_mm": float(max(-inside.min(), 0.0)),
            "height_mm": float(max(inside.max(), 0.0)),
            "area_mm2": float(self.mask.sum() * cell),
            "removed_mm3": float(-self.height_mm[low].sum() * cell),
            "added_mm3": float(self.height_mm[~low].sum() * cell),
        }

    def save(self, path: Path) -> None:
        """Write the file that `load` reads; the same relief gives the same bytes."""
        text = {
            "format": FORMAT, "version": VERSION, "name": self.name, "pitch_mm": self.pitch_mm,
            "dimensions": self.dimensions(), "facts": self.facts,
        }  # fmt: skip
        buffer = io.BytesIO()
        np.savez_compressed(
            buffer, allow_pickle=False, height_mm=self.height_mm, mask=self.mask,
            text=np.array(json.dumps(text)),
        )  # fmt: skip
        path.write_bytes(buffer.getvalue())

    @classmethod
    def load(cls, path: Path) -> Self:
        """Read a relief's file; see `of_bytes`."""
        return cls.of_bytes(path.read_bytes())

    @classmethod
    def of_bytes(cls, data: bytes) -> Self:
        """Read a relief from what its file holds.

        Raises
        ------
        ValueError
            When that isn't a relief; one line.
        """
        try:
            with np.load(io.BytesIO(data), allow_pickle=False) as kept:
                text = json.loads(str(kept["text"]))
                if text["format"] != FORMAT or text["version"] > VERSION:
                    raise ValueError(f"format {text['format']!r} of version {text['version']}")
                return cls(
                    name=str(text["name"]),
                    pitch_mm=float(text["pitch_mm"]),
                    height_mm=np.asarray(kept["height_mm"], np.float64),
                    mask=np.asarray(kept["mask"]),
                    facts=text["facts"],
                )
        except Exception as error:  # numpy, zipfile, zlib and json each raise their own
            reason = error if isinstance(error, ValueError) else type(error).__name__
            raise ValueError(f"isn't a relief of a flaw ({reason})") from None


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class FlawBank:
    """Some reliefs, in the order of their files' names.

    Parameters
    ----------
    reliefs
        At least one.
    checksums
        SHA-256 of each file by its name, of the bytes that were read.
    """

    reliefs: tuple[Relief, ...]
    checksums: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def load(cls, paths: Sequence[Path]) -> Self:
        """Read the reliefs at some paths.

        Raises
        ------
        ValueError
            For the first file that isn't one, with its name.
        OSError
            When one can't be read.
        """
        reliefs, checksums = [], {}
        for path in sorted(paths, key=lambda path: path.name):
            data = path.read_bytes()
            try:
                reliefs.append(Relief.of_bytes(data))
            except ValueError as error:
                raise ValueError(f"{path.name}: {error}") from None
            checksums[path.name] = hashlib.sha256(data).hexdigest()
        return cls(reliefs=tuple(reliefs), checksums=checksums)

    def at(self, share: float) -> Relief:
        """Return the relief at a share of the bank, 0 the first and just below 1 the last."""
        last = len(self.reliefs) - 1
        return self.reliefs[min(int(share * len(self.reliefs)), last)]
