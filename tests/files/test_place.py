"""Places of datasets: folders, and prefixes of object stores by their URLs."""

import subprocess
import sys
from pathlib import Path

import pytest

import flawforge
from files.errors import RecipeError
from files.place import is_local, names, place, put, reached, reading

STORES = "needs universal-pathlib: flawforge[s3]"


def test_a_folder_imports_nothing():
    code = "import sys; from files.place import place; place('a'); print('upath' in sys.modules)"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout == "False\n"


def test_a_file_url_is_a_folder(tmp_path):
    pytest.importorskip("upath", reason=STORES)
    found = place(f"file://{tmp_path}/a")
    assert found == tmp_path / "a"
    assert is_local(found)


def test_an_object_is_put_and_read(tmp_path):
    pytest.importorskip("upath", reason=STORES)
    (tmp_path / "x").write_bytes(b"content")
    at = place("memory://files/place/")
    assert names(at) == []
    put(tmp_path / "x", at / "deep" / "x", new=True)
    assert names(at) == ["deep/x"]
    assert reading(at / "deep" / "x").read() == b"content"
    with pytest.raises(FileExistsError):
        put(tmp_path / "x", at / "deep" / "x", new=True)


def test_a_store_that_is_not_known_or_lacks_its_package_is_named(monkeypatch):
    pytest.importorskip("upath", reason=STORES)
    with pytest.raises(RecipeError, match="can't be used .Unsupported filesystem"):
        place("nosuchstore://bucket/x")
    monkeypatch.setitem(sys.modules, "upath", None)
    with pytest.raises(RecipeError, match=r"isn't installed .*pip install 'flawforge\[s3\]'"):
        place("s3://bucket/x")
    with pytest.raises(flawforge.ShardError, match=r"pip install 'flawforge\[s3\]'"):
        flawforge.open("s3://bucket/x")


def test_errors_of_a_store_are_one_line_and_those_of_a_folder_stay():
    line = r"s3://b/x: the object store can't be used \(first\)"
    with pytest.raises(RecipeError, match=line), reached("s3://b/x"):
        raise ConnectionError("first\nsecond")
    with pytest.raises(ConnectionError), reached(Path("here")):
        raise ConnectionError("first")
    with pytest.raises(FileNotFoundError), reached("s3://b/x", but=FileNotFoundError):
        raise FileNotFoundError
