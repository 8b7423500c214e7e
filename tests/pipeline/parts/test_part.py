"""Reading parts: every real file loads or says in one line why not; units; round trips."""

import pickle
import zipfile
from pathlib import Path

import manifold3d
import numpy as np
import pytest
import trimesh

from pipeline.parts.builtin import build
from pipeline.parts.mesh.bodies import manifold
from pipeline.parts.part import UNITS_MM, Part, find_parts, load_part
from pipeline.parts.part_error import PartError

# What independent readers (trimesh, per body) give for the volume, in the file's unit.
CAD = {
    "1002_tray_bottom.STL": 347865.8964,
    "ADIS16480.STL": 2.8192470e-5,
    "angle_block.STL": 1.1455225,
    "featuretype.STL": 11.6277334,
    "idler_riser.STL": 1.4878026,
    "large_block.STL": 3329153674.19,
    "octagonal_pocket.stl": 2.503528765e-4,
    "plate_holes.STL": 767362.1126,
    "round.stl": 277.914708,
    "torus.STL": 4.9175473,
    "unit_sphere.STL": 4.1527408,
}
BROKEN = {
    "Cray_right.obj": "coordinates up to 3.4e+38 mm",
    "empty.stl": "empty",
    "openscad-nonmanifold-crash.obj": "edges shared by more than two faces",
    "plane.ply": "4 open edges in 1 holes",
    "points_ascii.ply": "a cloud of 5 points without faces",
    "self_intersectA.obj": "self-intersection",
    "soup.stl": "300 open edges in 100 holes",
    "stl_empty_ascii.stl": "empty",
    "stl_empty_bin.stl": "empty",
    "teapot.stl": "open edges in 6 holes",
}
REPAIRED = {
    "Offset2.obj": (209026.719, ()),
    "busted.STL": (526.44891, ()),
    "capsule.obj": (7.3214314, ("200 faces without area dropped",)),
    "multibody.stl": (0.0074231, ("wound like their neighbours", "2 of them outward")),
    "shared.STL": (2.0, ("parted", "2 bodies that touch or overlap united")),
    "wallhole.obj": (3200.0 / 3.0, ("doubled", "without height")),
}


def assert_closed(part: Part) -> None:
    """Every edge runs once each way, and manifold3d agrees with the volume."""
    directed = part.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64)
    forth = directed[:, 0] * len(part.vertices_mm) + directed[:, 1]
    back = directed[:, 1] * len(part.vertices_mm) + directed[:, 0]
    assert len(np.unique(forth)) == len(forth)
    assert np.array_equal(np.sort(forth), np.sort(back))
    solid = manifold(part.vertices_mm, part.faces)
    assert solid.status() == manifold3d.Error.NoError
    assert part.volume_mm3 > 0.0
    assert solid.volume() == pytest.approx(part.volume_mm3, rel=1e-9)


@pytest.mark.parametrize("name", sorted(CAD))
def test_cad_file_loads_closed_with_its_volume(shared_dir: Path, name: str) -> None:
    unit = "m" if name.startswith("ADIS") else "inch" if name.startswith("angle") else "mm"
    part = load_part(shared_dir / "meshes" / "cad" / name, unit=unit)
    assert_closed(part)
    assert part.volume_mm3 == pytest.approx(CAD[name] * UNITS_MM[unit] ** 3, rel=1e-6)
    assert part.name == name.rsplit(".", 1)[0]


@pytest.mark.parametrize(("name", "bodies"), [("box.STL", 10), ("cycloidal.ply", 118)])
def test_overlapping_bodies_are_united(shared_dir: Path, name: str, bodies: int) -> None:
    part = load_part(shared_dir / "meshes" / "cad" / name, unit="inch")
    assert_closed(part)
    assert f"{bodies} bodies that touch or overlap united" in part.mended
    mesh = trimesh.load(shared_dir / "meshes" / "cad" / name)
    separate = mesh.volume * 25.4**3
    # What overlaps is counted once now; in these assemblies that is below two percent.
    assert 0.98 * separate < part.volume_mm3 < separate


@pytest.mark.parametrize("name", sorted(BROKEN))
def test_broken_file_gives_one_clear_line(shared_dir: Path, name: str) -> None:
    with pytest.raises(PartError) as caught:
        load_part(shared_dir / "meshes" / "broken" / name)
    line = str(caught.value)
    assert name in line
    assert BROKEN[name] in line
    assert "; mend: " in line
    assert "\n" not in line
    assert len(line) < 400


@pytest.mark.parametrize("name", sorted(REPAIRED))
def test_repairable_file_says_what_was_mended(shared_dir: Path, name: str) -> None:
    volume, words = REPAIRED[name]
    part = load_part(shared_dir / "meshes" / "broken" / name)
    assert_closed(part)
    assert part.volume_mm3 == pytest.approx(volume, rel=2e-5)
    assert bool(part.mended) == bool(words)
    for word in words:
        assert any(word in note for note in part.mended)


def test_no_broken_file_is_forgotten(shared_dir: Path) -> None:
    found = {path.name for path in find_parts(shared_dir / "meshes" / "broken")}
    assert found == BROKEN.keys() | REPAIRED.keys()


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply", "3mf"])
def test_round_trip_through_file(tmp_path: Path, suffix: str) -> None:
    plate = build("steel_plate", length_mm=50.0, width_mm=40.0, thickness_mm=14.0)
    path = tmp_path / f"plate.{suffix}"
    trimesh.Trimesh(plate.vertices_mm, plate.faces, process=False).export(path)
    back = load_part(path, name="again")
    assert_closed(back)
    assert back.name == "again"
    assert len(back.faces) == len(plate.faces)
    # STL and PLY hold single precision, OBJ and 3MF decimal digits.
    np.testing.assert_allclose(
        np.sort(back.vertices_mm, axis=0), np.sort(plate.vertices_mm, axis=0), atol=5e-6
    )
    assert back.volume_mm3 == pytest.approx(plate.volume_mm3, rel=1e-6)
    assert back.mended == ()


@pytest.mark.parametrize(("unit", "factor"), list(UNITS_MM.items()))
def test_unit_scales_to_millimetres(tmp_path: Path, unit: str, factor: float) -> None:
    path = tmp_path / "box.obj"
    trimesh.creation.box((2.0, 3.0, 4.0)).export(path)
    part = load_part(path, unit=unit)
    np.testing.assert_allclose(np.ptp(part.bounds_mm, axis=0), factor * np.array([2.0, 3.0, 4.0]))
    assert part.volume_mm3 == pytest.approx(24.0 * factor**3)


def test_double_precision_survives(tmp_path: Path) -> None:
    box = trimesh.creation.box((1.0, 1.0, 1.0))
    box.vertices[:, 0] += 400.0 + 1e-9
    path = tmp_path / "box.obj"
    path.write_text(trimesh.exchange.obj.export_obj(box, digits=12))
    part = load_part(path)
    assert part.bounds_mm[1, 0] == pytest.approx(400.5 + 1e-9, abs=1e-12)


def test_3mf_says_its_own_unit(tmp_path: Path) -> None:
    path, inches = tmp_path / "box.3mf", tmp_path / "inches.3mf"
    trimesh.creation.box((1.0, 1.0, 1.0)).export(path)
    with zipfile.ZipFile(path) as source, zipfile.ZipFile(inches, "w") as target:
        for name in source.namelist():
            content = source.read(name).replace(b'unit="millimeter"', b'unit="inch"')
            target.writestr(name, content)
    assert load_part(path, unit="mm").volume_mm3 == pytest.approx(1.0)
    part = load_part(inches)
    assert part.volume_mm3 == pytest.approx(25.4**3)
    assert part.mended == ("unit inch taken from the file",)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.stl", b"", "0 bytes"),
        ("a.obj", b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "NaN"),
        ("a.obj", b"v inf 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "infinite"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "not a readable OBJ file"),
        ("a.obj", b"v 0 0 0\nv 1e-9 0 0\nv 0 1e-9 0\nf 1 2 3\n", "large"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "without volume"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nf 1 2 2\n", "no face has an area"),
        ("a.stl", b"solid made of words, not numbers\nfacet normal x y z\n", "no faces"),
        ("a.stl", bytes(range(256)) * 3, "damaged"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 3\n", "not a readable PLY file"),
        ("a.3mf", b"PK\x03\x04 torn", "not a readable 3MF file"),
        ("a.txt", b"hello", "not a mesh format"),
        ("a", b"hello", "no suffix"),
    ],
)
def test_damaged_file_is_refused(tmp_path: Path, name: str, content: bytes, words: str) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(PartError) as caught:
        load_part(path)
    assert words in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_truncated_binary_stl_is_refused(tmp_path: Path) -> None:
    whole = tmp_path / "whole.stl"
    trimesh.creation.icosphere(subdivisions=2).export(whole)
    torn = tmp_path / "torn.stl"
    torn.write_bytes(whole.read_bytes()[:-1500])
    with pytest.raises(PartError, match="header says 320 facets, the file holds 290"):
        load_part(torn)


def test_missing_file_and_bad_arguments(tmp_path: Path) -> None:
    with pytest.raises(PartError, match="no such file"):
        load_part(tmp_path / "none.stl")
    (tmp_path / "folder.stl").mkdir()
    with pytest.raises(PartError, match="not a file"):
        load_part(tmp_path / "folder.stl")
    with pytest.raises(PartError, match="unknown unit 'feet'.*inch"):
        load_part(tmp_path / "none.stl", unit="feet")


def test_a_long_check_is_announced(tmp_path: Path, monkeypatch, caplog) -> None:
    path = tmp_path / "ball.stl"
    trimesh.creation.icosphere(subdivisions=2).export(path)
    load_part(path)
    assert not caplog.records
    monkeypatch.setattr("pipeline.parts.part.MANY", 320)
    load_part(path)
    assert caplog.messages == [f"{path}: checking 320 triangles; this may take minutes"]


def test_part_is_frozen_and_picklable() -> None:
    plate = build("steel_plate")
    with pytest.raises(ValueError, match="read-only"):
        plate.vertices_mm[0, 0] = 1.0
    with pytest.raises(AttributeError):
        plate.name = "other"  # type: ignore[misc]
    again = pickle.loads(pickle.dumps(plate))
    np.testing.assert_array_equal(again.vertices_mm, plate.vertices_mm)
    assert again.regions.keys() == plate.regions.keys()
    error = pickle.loads(pickle.dumps(PartError("a.stl", "broken", "mend it")))
    assert str(error) == "a.stl: broken; mend: mend it"


def test_region_must_fit_the_faces() -> None:
    with pytest.raises(ValueError, match="region 'top'"):
        Part(
            name="x",
            vertices_mm=np.zeros((3, 3)),
            faces=np.array([[0, 1, 2]], dtype=np.int32),
            regions={"top": np.ones(2, dtype=bool)},
        )


def test_find_parts_is_sorted_and_knows_meshes(tmp_path: Path) -> None:
    for name in ("b.stl", "a.STL", "sub/c.ply", "notes.txt", "[x].obj"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"x")
    names = [path.name for path in find_parts(tmp_path / "*")]
    assert names == ["[x].obj", "a.STL", "b.stl"]
    deep = [path.name for path in find_parts(tmp_path / "**" / "*")]
    assert sorted(deep) == ["[x].obj", "a.STL", "b.stl", "c.ply"]
    assert find_parts(tmp_path / "[x].obj") == [tmp_path / "[x].obj"]
    assert find_parts(tmp_path / "none.stl") == [tmp_path / "none.stl"]
    assert [path.name for path in find_parts(tmp_path)] == names
    with pytest.raises(PartError, match="no mesh file matches"):
        find_parts(tmp_path / "*.obk")
