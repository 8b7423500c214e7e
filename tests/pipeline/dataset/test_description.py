"""A dataset's own description, read by mlcroissant and by its reader."""

import json
import re
from pathlib import Path

import pandas as pd
import pytest

from pipeline.batch.run import generate
from pipeline.dataset.verify import verify
from pipeline.recipe import Recipe


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of rdflib, which mlcroissant reads with
@pytest.mark.filterwarnings("ignore::FutureWarning")
def test_mlcroissant_accepts_and_loads_both_tables(made_once: Path) -> None:
    croissant = pytest.importorskip("mlcroissant")
    dataset = croissant.Dataset(jsonld=str(made_once / "croissant.json"))
    assert not dataset.metadata.ctx.issues.errors
    for name in ("manifest", "flaws"):
        table = pd.read_parquet(made_once / f"{name}.parquet")
        records = list(dataset.records(name))
        assert len(records) == len(table) > 0
        for record, row in zip(records, table.to_dict("records"), strict=True):
            assert {key.removeprefix(f"{name}/") for key in record} == set(table.columns)
            scan_id = record[f"{name}/scan_id"]
            assert (scan_id.decode() if isinstance(scan_id, bytes) else scan_id) == row["scan_id"]
        pixels = "flaws/pixels" if name == "flaws" else "manifest/flaws"
        assert [r[pixels] for r in records] == list(table[pixels.partition("/")[2]])


def test_the_files_are_the_same_on_a_rebuild_and_checked(once: Path, recipe_path: Path) -> None:
    again = recipe_path.parent / "again"
    generate(Recipe.load(recipe_path), again)
    for name in ("README.md", "croissant.json"):
        assert (again / name).read_bytes() == (once / name).read_bytes()
    assert verify(once).wrong == 0
    (once / "README.md").write_text("other")
    (once / "croissant.json").unlink()
    lines = verify(once).lines
    assert lines[0].startswith("README.md: damaged")
    assert lines[1] == "croissant.json: missing"


def test_every_shard_is_listed_with_its_checksum(made_once: Path) -> None:
    said = json.loads((made_once / "dataset.json").read_text())
    files = json.loads((made_once / "croissant.json").read_text())["distribution"]
    listed = {file["name"]: file["sha256"] for file in files}
    assert {name: facts["sha256"] for name, facts in said["shards"].items()}.items() <= (
        listed.items()
    )


def test_the_readmes_code_runs(made_once: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = (made_once / "README.md").read_text()
    (code,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    monkeypatch.chdir(made_once)
    names: dict[str, object] = {}
    exec(compile(code, "README.md", "exec"), names)  # our own README
    assert names["depth"].shape == names["mask"].shape  # type: ignore[attr-defined]  # arrays
    (recipe,) = re.findall(r"```yaml\n(.*?)```", text, re.DOTALL)
    assert "steel_plate" in recipe
