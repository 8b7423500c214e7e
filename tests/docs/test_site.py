"""The site builds without a warning, holds every page, and needs no network."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

HOME = Path(__file__).resolve().parents[2]
FETCHED = re.compile(
    r"""<(?:script|img|iframe)\b[^>]*\bsrc=["']https?:|<link\b[^>]*\bhref=["']https?:"""
    r"""|url\(["']?https?:|@import\s+["']https?:"""
)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("site") / "site"
    built = subprocess.run(
        [sys.executable, str(HOME / "docs/site/build.py"), str(out)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert built.returncode == 0, built.stderr
    return out


@pytest.mark.slow
def test_every_page_is_on_the_site(site: Path) -> None:
    for page in (HOME / "docs").glob("**/*.md"):
        if page.name != "cost.md":  # a table of flaws.md
            place = page.relative_to(HOME / "docs").with_suffix(".html")
            assert (site / place).is_file(), place


@pytest.mark.slow
def test_generated_pages_hold_what_the_code_states(site: Path) -> None:
    from flawforge.cli import COMMANDS

    commands = (site / "reference/cli.html").read_text()
    for command in COMMANDS:
        assert f'id="flawforge-{command}"' in commands
    assert 'id="flawforge.generate"' in (site / "reference/api.html").read_text()
    assert "triangulation_angle_deg" in (site / "reference/sensor.html").read_text()


@pytest.mark.slow
def test_nothing_is_fetched_from_a_network(site: Path) -> None:
    for path in site.rglob("*"):
        if path.suffix in (".html", ".css"):
            assert not FETCHED.search(path.read_text()), path


@pytest.mark.slow
def test_a_broken_link_stops_the_build(tmp_path: Path) -> None:
    code = (
        "import sys; sys.argv = ['build.py', sys.argv[1]]\n"
        f"sys.path.insert(0, {str(HOME / 'docs/site')!r})\n"
        "import build\n"
        "page = '# Page\\n\\n[x](nowhere.md)\\n'\n"
        "build.stage = lambda folder: (folder / 'index.md').write_text(page)\n"
        "sys.exit(build.main())\n"
    )
    built = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "site")],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert built.returncode == 1
    assert "nowhere.md" in built.stderr
