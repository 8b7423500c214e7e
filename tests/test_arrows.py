"""The house: imports point one way, and each library has its place."""

import ast
import functools
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
MAY_IMPORT = {
    "flawforge": {"flawforge", "pipeline", "diagnosis", "challenge", "sensors", "defects"},
    "pipeline": {"pipeline", "defects", "sensors"},
    "diagnosis": {"diagnosis", "sensors"},
    "defects": {"defects"},
    "sensors": {"sensors"},
    "challenge": {"challenge"},
}
ONE_PLACE = {
    "joblib": {"pipeline/batch/backend.py"},
    "embreex": {"sensors/casting/embree.py"},
    "pydantic": {"sensors/typed_yaml.py", "pipeline/size_field.py", "pipeline/recipe.py"},
    "yaml": {"sensors/typed_yaml.py"},
    "distributed": {"pipeline/batch/cluster.py"},
}
ALLOWED_IN_DATASET = {"numpy", "h5py", "pandas"}


@functools.cache
def imports(path: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            found.add(node.module or "")
    return {name.split(".")[0] for name in found}


def sources(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


def test_arrows_point_one_way():
    assert sources("pipeline")
    for package, allowed in MAY_IMPORT.items():
        for path in sources(package):
            wrong = (imports(path) & set(MAY_IMPORT)) - allowed
            assert not wrong, f"{path.relative_to(ROOT)} imports {wrong}"


def test_nothing_installed_imports_tests_or_benchmarks():
    for package in MAY_IMPORT:
        for path in sources(package):
            assert not imports(path) & {"tests", "benchmarks", "pytest", "hypothesis"}, path


def test_each_library_has_its_place():
    for library, places in ONE_PLACE.items():
        for package in set(MAY_IMPORT) - {"challenge"}:
            for path in sources(package):
                if library in imports(path):
                    assert str(path.relative_to(ROOT)) in places, f"{path} imports {library}"


def test_the_reader_needs_three_libraries():
    import sys

    outside = imports(ROOT / "flawforge" / "dataset.py") - set(sys.stdlib_module_names)
    assert outside <= ALLOWED_IN_DATASET
