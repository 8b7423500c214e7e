"""Files that pages, docstrings and comments name are there."""

import re

from tests.support.page_script import HOME

FOLDERS = (
    "flawforge", "pipeline", "defects", "sensors", "diagnosis", "challenge", "quantity", "files",
    "benchmarks", "docs", "tests", "manifests",
)  # fmt: skip
NAMED = re.compile(rf"(?<![\w/.-])(?:{'|'.join(FOLDERS)})/[\w/.-]+\.(?:py|md|yaml|j2)\b")
TO_BE_MADE = {
    "defects/kinds/dimple.py", "sensors/presets/ACME-300.yaml", "sensors/effects/heat_haze.py",
    "pipeline/dataset/export/forms/xyz.py", "tests/pipeline/dataset/export/test_xyz.py",
    "docs/test-record.md",
}  # fmt: skip
"""What a reader is asked to write."""


def test_named_files_are_there() -> None:
    files = [file for folder in FOLDERS for file in (HOME / folder).glob("**/*")]
    sources = [file for file in files if file.suffix in (".md", ".py")]
    missing = set()
    for file in (*sources, HOME / "README.md", HOME / "CONTRIBUTING.md"):
        named = set(NAMED.findall(file.read_text(encoding="utf-8"))) - TO_BE_MADE
        missing |= {(str(file), name) for name in named if not (HOME / name).exists()}
    assert len(sources) > 400
    assert not missing
