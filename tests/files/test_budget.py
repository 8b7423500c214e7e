"""Budgets and odd inputs: refused in one line before memory or time is spent."""

import os
import struct
import zipfile

import h5py
import numpy as np
import pytest

from files.budget import allow, limit, regular
from files.errors import RecipeError
from files.yaml_document import load_yaml
from sensors.formats import read_height_map
from sensors.recording import Recording


def test_limits_are_raised_by_the_environment(monkeypatch):
    assert limit("readings") == 1e8
    with pytest.raises(RecipeError, match="FLAWFORGE_LIMITS=readings=NUMBER raises it"):
        allow("readings", 2e8, where="a.npy")
    monkeypatch.setenv("FLAWFORGE_LIMITS", "readings=3e8,unpacked=1")
    allow("readings", 2e8, where="a.npy")
    monkeypatch.setenv("FLAWFORGE_LIMITS", "reading=3")
    with pytest.raises(RecipeError, match="unknown limit"):
        limit("readings")
    monkeypatch.setenv("FLAWFORGE_LIMITS", "readings=many")
    with pytest.raises(RecipeError, match="isn't a number"):
        limit("readings")


def test_pipes_devices_and_folders_are_no_files(tmp_path):
    os.mkfifo(tmp_path / "a.csv")
    for path, said in ((tmp_path / "a.csv", "a pipe"), (tmp_path, "a folder"),
                       (tmp_path / "b", "no such file")):  # fmt: skip
        with pytest.raises(RecipeError, match=said):
            regular(path)
    for read in (read_height_map, Recording.load):
        with pytest.raises(RecipeError, match="a pipe"):
            read(tmp_path / "a.csv")
    os.mkfifo(tmp_path / "a.yaml")
    with pytest.raises(RecipeError, match="isn't a regular file"):
        load_yaml(tmp_path / "a.yaml")


def test_an_npy_header_of_petabytes(tmp_path):
    head = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000, 1000000), }"
    head = head.ljust(118 - 1) + b"\n"
    blob = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head + bytes(80)
    (tmp_path / "a.npy").write_bytes(blob)
    with pytest.raises(RecipeError, match="announces 1e\\+15 readings"):
        read_height_map(tmp_path / "a.npy")
    blob = blob.replace(b"(1000000000, 1000000)", b"(100, 1000)          ")
    (tmp_path / "b.npy").write_bytes(blob)
    with pytest.raises(RecipeError, match="ends early, got '80 bytes'"):
        read_height_map(tmp_path / "b.npy")


def test_a_range_grid_of_billions(tmp_path):
    text = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
    text += "property float z\nelement range_grid 1000000000000\n"
    text += "property list uchar int vertex_indices\nend_header\n0 0 1\n1 0\n"
    (tmp_path / "a.ply").write_text(text)
    with pytest.raises(RecipeError, match="1000000000000 entries are announced"):
        read_height_map(tmp_path / "a.ply")


def test_an_archive_that_unpacks_to_gigabytes(tmp_path, monkeypatch):
    monkeypatch.setenv("FLAWFORGE_LIMITS", "unpacked=1e6")
    with zipfile.ZipFile(tmp_path / "a.x3p", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("main.xml", bytes(2_000_000))
    with pytest.raises(RecipeError, match="announces 2e\\+06 unpacked"):
        read_height_map(tmp_path / "a.x3p")


def test_a_recording_that_announces_more_than_it_holds(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.attrs["format"] = "profilometer-recording"
        file.create_dataset("depth", shape=(10**6, 10**6), dtype="f4", chunks=(1, 1000))
        file.create_dataset("pose", data=np.zeros((1, 4, 4)))
        file.create_dataset("time", data=np.zeros(1))
    with pytest.raises(RecipeError, match="announces 1e\\+12 readings"):
        Recording.load(tmp_path / "a.h5")


BOMB = "\n".join(
    f"k{n}: &k{n} [{', '.join([f'*k{n - 1}'] * 9)}]" if n else "k0: &k0 [x, x, x, x, x, x, x, x, x]"
    for n in range(9)
)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (BOMB, "too many values, aliases counted"),
        ("a: " + "9" * 5000, "a number that is too long"),
        ('a: "\\ud800"', "lone surrogate"),
        ("a: " + "[" * 500, "isn't YAML|nested too deeply"),
        ("a: &a [*a]", "isn't YAML|refers to itself"),
        ("a: !!timestamp x", "isn't YAML"),
        ("a: !!python/object:os.system []", "isn't YAML"),
        ("a: " + "x" * 5_000_000, "too long for a hand-written file"),
    ],
    ids=["aliases", "digits", "surrogate", "nested", "itself", "timestamp", "object", "long"],
)
def test_yaml_that_asks_for_too_much(tmp_path, text, said):
    (tmp_path / "a.yaml").write_text(text)
    with pytest.raises(RecipeError, match=said):
        load_yaml(tmp_path / "a.yaml")
