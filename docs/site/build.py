"""Build the documentation's site: `python docs/site/build.py OUT`; any warning stops the build.

The pages are copied aside, with those that the code makes, and Sphinx reads them there. Nothing in
the checkout is written.
"""

import argparse
import importlib.util
import shutil
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

from sphinx.cmd.build import build_main

HERE = Path(__file__).resolve().parent
DOCS = HERE.parent
HOME = DOCS.parent
COPIED = ("*.md", "*.png")
API = {  # what a user imports, by module
    "flawforge": ("generate", "open", "export", "diagnose"),
    "flawforge.dataset": ("open", "Dataset", "ShardError"),
    "flawforge.torch": ("Scans", "Stream"),
    "sensors.recording": ("Recording",),
    "sensors.datasheet": ("Datasheet",),
    "sensors.surface.surface": ("Surface",),
    "sensors.model": ("SensorModel",),
    "sensors.law": ("Law",),
    "sensors.effects.effect": ("Effect",),
    "sensors.effects.base": ("AdditiveEffect", "MotionEffect"),
    "defects.kind": ("Kind",),
}
CLASSES_WITH_MEMBERS = ("Dataset", "Recording", "Datasheet", "Surface", "SensorModel", "Law")


def main() -> int:
    """Build; return Sphinx's exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path, help="folder of the site")
    out = parser.parse_args().out
    sys.path.insert(0, str(HOME))
    with tempfile.TemporaryDirectory() as folder:
        stage(Path(folder))
        shutil.rmtree(out, ignore_errors=True)
        words = ["-W", "--keep-going", "-q", "-b", "html", "-d", f"{folder}/.doctrees"]
        return build_main([*words, "-c", str(HERE), folder, str(out)])


def stage(folder: Path) -> None:
    """Copy the pages that are written by hand or measured, and make the others from the code."""
    for pattern in COPIED:
        for path in DOCS.rglob(pattern):
            there = folder / path.relative_to(DOCS)
            there.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, there)
    for place, make in pages().items():
        there = folder / place
        there.parent.mkdir(parents=True, exist_ok=True)
        there.write_text(make(), encoding="utf-8")


def pages() -> dict[str, Callable[[], str]]:
    """Return what makes each page that comes from the code, by its place on the site."""
    return {
        "recipe.md": script("recipe/make_recipe.py").page,
        "flaws.md": script("flaws/make_flaws.py").text,
        "effects.md": script("effects/make_effects.py").text,
        "reference/sensor.md": script("site/sensor_page.py").text,
        "reference/cli.md": script("site/cli_page.py").text,
        "reference/api.rst": api,
        "reference/changes.md": (HOME / "CHANGELOG.md").read_text,
        "reference/contributing.md": (HOME / "CONTRIBUTING.md").read_text,
    }


def script(place: str) -> ModuleType:
    """Import a script of the documentation, which belongs to no package."""
    path = DOCS / place
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def api() -> str:
    """Return the page of the Python API: what autodoc shall read."""
    title = "Python API"
    lines = [title, "=" * len(title), "", "Made by the site's build from the docstrings."]
    for module, names in API.items():
        lines += ["", module, "-" * len(module)]
        for name in names:
            directive = "autofunction" if name[0].islower() else "autoclass"
            directive = "autoexception" if name.endswith("Error") else directive
            lines += ["", f".. {directive}:: {module}.{name}"]
            if name in CLASSES_WITH_MEMBERS:
                lines += ["   :members:"]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.exit(main())
