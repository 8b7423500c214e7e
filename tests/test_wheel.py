"""The wheel holds all that a run needs: quickstart from the wheel alone, in an empty folder."""

import os
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

HOME = Path(__file__).resolve().parents[1]


def packages() -> list[str]:
    setuptools = tomllib.loads((HOME / "pyproject.toml").read_text())["tool"]["setuptools"]
    return [name.rstrip("*") for name in setuptools["packages"]["find"]["include"]]


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel built from a copy of the sources, unpacked as pip would."""
    pytest.importorskip("setuptools", reason="setuptools builds the wheel")
    folder = tmp_path_factory.mktemp("wheel")
    for name in packages():
        there = HOME / name
        if there.is_dir():
            shutil.copytree(there, folder / "src" / name, ignore=shutil.ignore_patterns("__*__"))
            for init in there.rglob("__init__.py"):
                shutil.copy(init, folder / "src" / init.relative_to(HOME))
    for name in ("pyproject.toml", "README.md"):
        shutil.copy(HOME / name, folder / "src")
    subprocess.run(
        [sys.executable, "-m", "pip", "wheel", "--quiet", "--disable-pip-version-check",
         "--no-deps", "--no-build-isolation", "--wheel-dir", str(folder), str(folder / "src")],
        check=True, capture_output=True,
    )  # fmt: skip
    (wheel,) = folder.glob("flawforge-*.whl")
    with zipfile.ZipFile(wheel) as file:
        file.extractall(folder / "site")
    return folder / "site"


@pytest.mark.slow
def test_the_wheel_holds_every_source_and_its_data(unpacked: Path) -> None:
    assert "flawforge" in packages()
    for package in packages():
        for path in (HOME / package).rglob("*"):
            if path.is_file() and path.suffix not in (".pyc", ".nbi", ".nbc"):
                assert (unpacked / path.relative_to(HOME)).is_file(), path.relative_to(HOME)
    assert not (unpacked / "tests").exists()


@pytest.mark.slow
def test_quickstart_runs_from_the_wheel_in_an_empty_folder(unpacked: Path, tmp_path: Path) -> None:
    sizes = ("specimens=1", "scans=1", "profiles=16", "points=40")
    small = [word for size in sizes for word in ("--set", size)]
    code = (
        "import sys, flawforge, pipeline\n"
        f"assert flawforge.__file__.startswith({str(unpacked)!r}), flawforge.__file__\n"
        f"assert pipeline.__file__.startswith({str(unpacked)!r}), pipeline.__file__\n"
        "from flawforge.cli import main\n"
        f"sys.exit(main(['generate', 'quickstart', '--out', 'data', *{small!r}]))"
    )
    environment = {**os.environ, "PYTHONPATH": str(unpacked), "PYTHONSAFEPATH": "1",
                   "NUMBA_CACHE_DIR": str(tmp_path / "cache")}  # fmt: skip
    run = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env=environment, capture_output=True, text=True
    )
    assert run.returncode == 0, run.stderr
    assert "3 scans" in run.stdout
    assert run.stderr.count("compiling the inner loops, once") == 1
    assert (tmp_path / "data" / "manifest.parquet").is_file()
