"""Which commit of the project a figure is of."""

import subprocess
from pathlib import Path


def commit() -> str:
    """Return the commit of this checkout, marked `-dirty` where it was changed since."""
    said = subprocess.run(
        ["git", "describe", "--always", "--dirty", "--abbrev=9"],
        capture_output=True, text=True, cwd=Path(__file__).parent, check=False,
    )  # fmt: skip
    return said.stdout.strip() or "unknown"
