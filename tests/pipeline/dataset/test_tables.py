"""Tables that are damaged or that lead out of a dataset are refused in one line."""

import shutil

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from files.errors import RecipeError
from flawforge.cli import main
from pipeline.dataset.tables import NAMES, is_plain, read_table

OUT = ("../x", "/etc/x", "a/../../b", "..", ".", "", "a\\b", "a\nb", "a\0b")


@pytest.mark.parametrize("name", OUT)
def test_names_that_lead_out(name, tmp_path):
    assert not is_plain(name)
    for end in ("parquet", "csv"):
        if end == "csv" and name in ("", "a\0b"):  # of CSV, nothing comes back
            continue
        table = pd.DataFrame({"scan_id": ["a", name]})
        path = tmp_path / f"t.{end}"
        table.to_parquet(path) if end == "parquet" else table.to_csv(path, index=False)
        with pytest.raises(RecipeError, match="'scan_id' isn't a plain name"):
            read_table(path)


@given(st.text(st.characters(categories=["L", "N"], include_characters="._- "), min_size=3))
def test_plain_names(name):
    assert is_plain(name) or name.strip(".") == ""


@pytest.mark.parametrize("column", [name for name in NAMES if name not in ("shard", "kind")])
@pytest.mark.parametrize("form", ["png", "coco", "ply", "mvtec3d", "webdataset", "yolo"])
def test_no_export_writes_outside_its_folder(column, form, small_dataset, tmp_path, capsys):
    shutil.copytree(small_dataset, tmp_path / "d")
    path = tmp_path / "d" / "manifest.parquet"
    table = pd.read_parquet(path)
    table[column] = "../../evil"
    table.to_parquet(path)
    before = sorted(tmp_path.rglob("*"))
    words = ["export", str(tmp_path / "d"), "--to", form, "--out", str(tmp_path / "e" / "f")]
    assert main(words) == 2
    assert "isn't a plain name, got '../../evil'" in capsys.readouterr().err
    assert sorted(tmp_path.rglob("*")) == before


def test_each_bit_of_a_text_is_noticed(tmp_path):
    """Texts are decoded when they are read, not where they are used first."""
    path = tmp_path / "t.parquet"
    pd.DataFrame({"scan_id": ["abcdefgh" * 8]}).to_parquet(path, compression=None)
    data = path.read_bytes()
    where = data.index(b"abcdefgh" * 8)
    path.write_bytes(data[:where] + b"\xb0" + data[where + 1 :])
    with pytest.raises(RecipeError, match="can't be read"):
        read_table(path)
