"""JSON files beside pictures, the same bytes every time."""

import json
from pathlib import Path
from typing import Any

from files.whole_file import write_whole


def write_json(path: Path, value: Any) -> Path:
    """Write plain data as JSON with a line for each entry; return the path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, json.dumps(value, indent=1, allow_nan=False) + "\n", synced=False)
    return path
