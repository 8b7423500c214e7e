"""Declaring a part's parameters: a number with its default, unit and bounds."""

from __future__ import annotations

from dataclasses import field
from typing import Any


def bounded(default: float, low: float, high: float, unit: str, meaning: str) -> Any:
    """Dataclass field of a part's parameter; `pipeline.parts.builtin.build` enforces the bounds."""
    return field(
        default=default, metadata={"low": low, "high": high, "unit": unit, "meaning": meaning}
    )
