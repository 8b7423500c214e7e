"""The house: imports point one way, and each library has its place."""

import ast
import functools
from pathlib import Path

import networkx as nx

ROOT = Path(__file__).resolve().parents[1]
MAY_IMPORT = {
    "flawforge": {
        "flawforge", "pipeline", "diagnosis", "challenge", "sensors", "defects", "quantity",
        "files",
    },
    "pipeline": {"pipeline", "defects", "sensors", "quantity", "files"},
    "diagnosis": {"diagnosis", "sensors", "quantity", "files"},
    "defects": {"defects", "quantity"},
    "sensors": {"sensors", "quantity", "files"},
    "challenge": {"challenge"},
    "files": {"files", "quantity"},
    "quantity": {"quantity"},
}
ROOMS_OF_THE_DIAGNOSIS = (
    "settings.py", "fields.py", "predict", "noise", "register", "data", "components", "model",
    "reregister", "evidence", "discrepancy", "physics", "validate", "localise", "claims",
    "diagnosis.py", "report", "prepare.py", "explanation.py", "usual_sizes.py", "first_look.py",
    "explain_laws.py", "explain_rates.py", "explain.py", "weighed_on_all.py",
    "explained_again.py", "refuted.py", "beside_unknown.py", "diagnose.py",
)  # fmt: skip
"""Each room imports from the rooms before it, never from one behind; types alone aside."""
ONE_PLACE = {
    "joblib": {"pipeline/batch/backend.py"},
    "embreex": {"sensors/casting/embree.py"},
    "pydantic": {"files/record.py", "pipeline/distribution_field.py", "pipeline/recipe.py"},
    "yaml": {"files/yaml_document.py"},
    "upath": {"files/place.py"},
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


@functools.cache
def needed(path: Path) -> frozenset[Path]:
    """Files of ours that a file imports, in functions too; what only types need is left out."""
    tree = ast.parse(path.read_text())
    typing_only = {
        id(inner)
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING")
        for statement in node.body
        for inner in ast.walk(statement)
    }
    names = set()
    for node in ast.walk(tree):
        if id(node) in typing_only:
            continue
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            # a name is a module of its package, or stands in the package's own file
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return frozenset(found for name in names if (found := file_of(name)) and found != path)


def file_of(name: str) -> Path | None:
    """File of a module, or of the module that a name stands in; None where it isn't ours."""
    place = ROOT / name.replace(".", "/")
    for at in (place, place.parent):
        for file in (at.with_suffix(".py"), at / "__init__.py"):
            if file.is_file():
                return file
    return None


def circles(edges: dict[Path, frozenset[Path]]) -> list[list[Path]]:
    graph = nx.DiGraph({source: list(targets) for source, targets in edges.items()})
    return [sorted(group) for group in nx.strongly_connected_components(graph) if len(group) > 1]


def sources(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


def test_arrows_point_one_way():
    assert sources("pipeline")
    for package, allowed in MAY_IMPORT.items():
        for path in sources(package):
            wrong = (imports(path) & set(MAY_IMPORT)) - allowed
            assert not wrong, f"{path.relative_to(ROOT)} imports {wrong}"


def test_no_circles_between_files():
    files = [path for package in MAY_IMPORT for path in sources(package)]
    found = circles({path: needed(path) for path in files})
    assert not found, [[str(path.relative_to(ROOT)) for path in group] for group in found]


def test_the_rooms_of_the_diagnosis_build_on_each_other():
    def place(path: Path) -> int:
        return ROOMS_OF_THE_DIAGNOSIS.index(path.relative_to(ROOT / "diagnosis").parts[0])

    files = [p for p in sources("diagnosis") if p != ROOT / "diagnosis" / "__init__.py"]
    assert {place(path) for path in files} == set(range(len(ROOMS_OF_THE_DIAGNOSIS)))
    for path in files:
        for other in needed(path):
            if other in files:
                names = [str(p.relative_to(ROOT)) for p in (path, other)]
                assert place(other) <= place(path), f"{names[0]} imports {names[1]}"


def test_a_circle_is_seen():
    law, model, view = (ROOT / "sensors" / name for name in ("law.py", "model.py", "view/view.py"))
    assert law in needed(model)
    assert view in needed(law)
    assert model not in needed(view)  # needed for its type alone
    assert circles({path: needed(path) for path in (law, model, view)}) == []
    assert circles({law: frozenset({view}), view: frozenset({law})}) == [[law, view]]


def test_nothing_installed_imports_tests_or_benchmarks():
    for package in MAY_IMPORT:
        for path in sources(package):
            assert not imports(path) & {"tests", "benchmarks", "pytest", "hypothesis"}, path


def test_every_room_stands_in_contributing():
    page = (ROOT / "CONTRIBUTING.md").read_text()
    rooms = {
        path.parent.relative_to(ROOT)
        for package in MAY_IMPORT
        for path in sources(package)
    }
    missing = [room for room in rooms if len(room.parts) == 2 and f"`{room}/`" not in page]
    assert not missing
    assert len(rooms) > 20


def test_no_test_needs_a_benchmark_but_its_own():
    files = [path for path in sources("tests") if ROOT / "tests/benchmarks" not in path.parents]
    assert ROOT / "tests/support/small_parts.py" in files
    for path in files:
        assert "benchmarks" not in imports(path), f"{path.relative_to(ROOT)} imports benchmarks"


def test_no_test_needs_another_test():
    """What tests share lies in `tests/support`, or in fixtures."""
    for path in (*sources("tests"), *sources("benchmarks"), *sources("docs")):
        shared = {file.name for file in needed(path) if ROOT / "tests" in file.parents}
        wrong = [name for name in shared if name.startswith("test_") or name == "conftest.py"]
        assert not wrong, f"{path.relative_to(ROOT)} imports {wrong}"


def test_each_library_has_its_place():
    for library, places in ONE_PLACE.items():
        for package in set(MAY_IMPORT) - {"challenge"}:
            for path in sources(package):
                if library in imports(path):
                    assert str(path.relative_to(ROOT)) in places, f"{path} imports {library}"


def test_the_reader_needs_three_libraries():
    import sys

    for name in ("dataset.py", "open_shard.py", "shard_folder.py"):
        outside = imports(ROOT / "flawforge" / name) - set(sys.stdlib_module_names)
        assert outside <= {*ALLOWED_IN_DATASET, "flawforge"}
        ours = {path.name for path in needed(ROOT / "flawforge" / name)}
        assert ours <= {"open_shard.py", "shard_folder.py", "__init__.py"}
