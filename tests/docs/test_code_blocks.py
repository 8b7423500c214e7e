"""The code blocks of the README, the tutorial and the how-tos run as they stand."""

import shutil
from pathlib import Path

import pytest

from tests.support.page_script import HOME, script

PAGES = sorted(["README.md", "docs/tutorial.md", *(
    str(path.relative_to(HOME)) for path in (HOME / "docs/how-to").glob("*.md")
)])  # fmt: skip
NEEDS = {"docs/how-to/train.md": "torch"}  # extras that are not installed for the tests


BLOCKS = script("site/blocks.py")


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES)
def test_every_block_of_the_page_runs(page: str, tmp_path: Path) -> None:
    if page in NEEDS:
        pytest.importorskip(NEEDS[page], reason=f"the page needs {NEEDS[page]}")
    BLOCKS.run(HOME / page, tmp_path)


@pytest.mark.slow
def test_the_blocks_of_the_import_page_run_on_the_real_file(
    shared_dir: Path, tmp_path: Path
) -> None:
    shutil.copy(shared_dir / "real/sick/OCR_3D_image_42.json", tmp_path / "image_42.json")
    BLOCKS.run(HOME / "docs/import.md", tmp_path)


def _page(tmp_path: Path, text: str) -> Path:
    page = tmp_path / "page.md"
    page.write_text(text)
    return page


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("```bash\nfalse\n```\n", "page.md:1: exit code 1"),
        ("x\n\n```python\nprint(1)\n```\n\n```text\n2\n```\n", "page.md:7: no line '2'"),
        ("```\nls\n```\n", "page.md:1: language ''"),
    ],
)
def test_a_wrong_block_fails_with_its_place(text: str, message: str, tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    with pytest.raises(BLOCKS.BlockError, match=message):
        BLOCKS.run(_page(tmp_path, text), folder)


def test_files_outputs_and_lone_text_are_told_apart(tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    text = (
        "```yaml\n# made.yaml, of ours\na: 1\n```\n\n"
        "```bash\ntail -1 made.yaml; echo 3.4 s\n```\n\n"
        "```text\na: 1\n... s\n```\n\nOr:\n\n```text\nnot run\n```\n"
    )
    BLOCKS.run(_page(tmp_path, text), folder)
