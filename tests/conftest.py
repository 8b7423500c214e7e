"""Fixtures that all tests share."""

from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def shared_dir() -> Path:
    """Real meshes and recordings beside the checkout; tests that need them skip without."""
    path = Path(__file__).resolve().parents[1].parent / "shared"
    if not (path / "meshes").is_dir():
        pytest.skip("no shared/ folder with real meshes and recordings beside the checkout")
    return path
