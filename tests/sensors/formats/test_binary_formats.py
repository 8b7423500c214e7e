"""SDF, BCR, images with pages and channels, and what other packages read: round trips."""

import struct
import zipfile

import numpy as np
import pytest
import tifffile
from PIL import Image

from files.errors import RecipeError
from sensors.formats import read_height_map
from sensors.formats.conversion import Setup, convert
from sensors.formats.motion import read_poses, read_rows
from sensors.recording import Recording
from tests.support.instrument_files import plate


@pytest.mark.parametrize(("kind", "dtype"), [(5, "<i2"), (6, "<i4"), (3, "<f4"), (7, "<f8")])
def test_binary_sdf(tmp_path, kind, dtype):
    raw = np.rint(plate() * 100).astype(dtype)
    gone = np.zeros(raw.shape, bool)
    gone[2, 3] = True
    raw[gone] = np.nan if dtype[1] == "f" else np.iinfo(dtype).min
    head = b"bISO-1.0" + b"MAKER".ljust(10) + b"011120261200" * 2
    head += struct.pack("<HH", raw.shape[1], raw.shape[0])
    head += struct.pack("<dddd", 1e-4, 2e-4, 1e-5, 1e-6) + struct.pack("<bbb", 0, kind, 0)
    (tmp_path / "a.sdf").write_bytes(head + raw.tobytes())
    found = read_height_map(tmp_path / "a.sdf")
    np.testing.assert_array_equal(np.isnan(found.readings_mm), gone)
    np.testing.assert_allclose(found.readings_mm[~gone], np.rint(plate() * 100)[~gone] * 0.01)
    np.testing.assert_allclose(found.x_mm, 0.1 * np.arange(raw.shape[1]))
    np.testing.assert_allclose(found.y_mm, 0.2 * np.arange(raw.shape[0]))
    (tmp_path / "b.sdf").write_bytes(head + raw.tobytes()[:-9])
    with pytest.raises(RecipeError, match="ends early"):
        read_height_map(tmp_path / "b.sdf")


def test_text_sdf_with_bad_points(tmp_path):
    words = ["aISO-1.0", "NumPoints = 3", "NumProfiles = 2", "Xscale = 1E-6", "Yscale = 2E-6"]
    words += ["Zscale = 1E-6", "Zresolution = -1", "Compression = 0", "DataType = 7", "*"]
    (tmp_path / "a.sdf").write_text("\n".join([*words, "1 BAD 3", "4 5 6", "*"]))
    found = read_height_map(tmp_path / "a.sdf")
    np.testing.assert_allclose(found.readings_mm, 1e-3 * np.array([[1, np.nan, 3], [4, 5, 6]]))
    assert found.step_mm is None


@pytest.mark.parametrize("form", ["bcrstm", "bcrf", "bcrf_unicode"])
def test_bcr(tmp_path, form):
    raw = np.rint(plate() * 100)
    head = f"fileformat = {form}\nheadersize = 2048\nxpixels = {raw.shape[1]}\n"
    head += f"ypixels = {raw.shape[0]}\nxlength = 3000\nylength = 2400\nbit2nm = 2\nintelmode = 1\n"
    head += "voidpixels = 1\n"
    unicode = "unicode" in form
    packed = head.encode("utf-16-le") if unicode else head.encode()
    dtype = "<f4" if "bcrf" in form else "<i2"
    data = raw.astype(dtype)
    data[1, 1] = 3.4e38 if dtype == "<f4" else 32767
    blob = packed.ljust(4096 if unicode else 2048, b"\0") + data.tobytes()
    (tmp_path / "a.bcr").write_bytes(blob)
    found = read_height_map(tmp_path / "a.bcr")
    assert np.isnan(found.readings_mm[1, 1])
    raw[1, 1] = np.nan
    np.testing.assert_allclose(found.readings_mm, raw * 2e-6, rtol=1e-6)
    np.testing.assert_allclose(found.x_mm[1], 1e-4)


@pytest.mark.parametrize("top", [255, 1000, 4000, 60000])
def test_second_page_is_brightness(tmp_path, top):
    heights = np.rint(plate() * 1000).astype(np.uint16)
    bright = np.linspace(0, top, heights.size).reshape(heights.shape).astype(np.uint16)
    with tifffile.TiffWriter(tmp_path / "a.tif") as file:
        file.write(heights)
        file.write(bright)
    found = read_height_map(tmp_path / "a.tif", "um")
    np.testing.assert_allclose(found.readings_mm, heights * 1e-3)
    full = next(f for f in (255, 1023, 4095, 65535) if top <= f)
    np.testing.assert_allclose(found.intensity, bright / full)


def test_three_channels_are_places(tmp_path):
    table = plate(12, 16)
    y, x = np.meshgrid(0.5 * np.arange(12), 0.2 * np.arange(16), indexing="ij")
    grid = np.stack([x, y, table], axis=2).astype(np.float32) * 1e-3
    grid[3, 3] = grid[4, 4] = 0.0
    tifffile.imwrite(tmp_path / "a.tiff", grid, photometric="rgb")
    found = read_height_map(tmp_path / "a.tiff", "m")
    assert np.isnan(found.readings_mm[3, 3])
    np.testing.assert_allclose(found.readings_mm[0], table[0], rtol=1e-6)
    np.testing.assert_allclose(found.x_mm, 0.2 * np.arange(16), atol=1e-6)
    with pytest.raises(RecipeError, match="states no unit"):
        convert(read_height_map(tmp_path / "a.tiff"), Setup(name="a"))


def test_png_of_16_bit_and_its_marks(tmp_path):
    counts = np.rint(plate() * 1000).astype(np.uint16)
    counts[2, 2:6] = 0
    Image.fromarray(counts).save(tmp_path / "a.png")
    heights = read_height_map(tmp_path / "a.png")
    setup = {"name": "a", "pitch_x_mm": 0.2, "pitch_y_mm": 0.2, "z_step_mm": 0.001}
    with pytest.raises(RecipeError, match="--missing 0"):
        convert(heights, Setup(**setup))
    done = convert(heights, Setup(**setup, missing=(0.0,), z_offset_mm=5.0))
    kept = counts > 0
    depth = done.recording.depth_mm
    np.testing.assert_array_equal(np.isnan(depth), ~kept)
    wanted = done.sensor.working_distance_mm - (counts * 0.001 + 5.0)
    np.testing.assert_allclose(depth[kept], wanted[kept])
    colours = np.zeros((4, 4, 3), np.uint8)
    Image.fromarray(colours).save(tmp_path / "b.png")
    with pytest.raises(RecipeError, match="one channel"):
        read_height_map(tmp_path / "b.png")


def test_marks_of_single_precision_are_found_by_their_decimals():
    readings = plate().astype(np.float32)
    readings[1, 1:4] = np.float32(-99.9999)
    from sensors.formats.height_map import HeightMap

    heights = HeightMap(readings_mm=readings.astype(np.float64))
    done = convert(heights, Setup(name="a", pitch_x_mm=1, pitch_y_mm=1, missing=(-99.9999,)))
    assert np.isnan(done.recording.depth_mm).sum() == 3


def test_what_surface_topography_reads(tmp_path):
    topography = pytest.importorskip("SurfaceTopography")
    table = plate(20, 30)
    made = topography.Topography(table.T, (3.0, 4.0), unit="mm")
    pytest.importorskip("netCDF4")
    made.to_netcdf(str(tmp_path / "a.nc"))
    found = read_height_map(tmp_path / "a.nc")
    np.testing.assert_allclose(found.readings_mm, table)
    np.testing.assert_allclose(found.x_mm, 0.1 * np.arange(30))
    np.testing.assert_allclose(found.y_mm, 0.2 * np.arange(20))
    (tmp_path / "b.al3d").write_bytes(b"nothing")
    with pytest.raises(RecipeError, match="can't be read by SurfaceTopography"):
        read_height_map(tmp_path / "b.al3d")


def test_las_points_on_a_grid(tmp_path):
    laspy = pytest.importorskip("laspy")
    table = plate(12, 16)
    y, x = np.meshgrid(0.5 * np.arange(12), 0.2 * np.arange(16), indexing="ij")
    header = laspy.LasHeader(point_format=0, version="1.2")
    header.scales = [1e-7] * 3
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = (v.ravel() * 1e-3 for v in (x, y, table))
    cloud.write(tmp_path / "a.las")
    found = read_height_map(tmp_path / "a.las")
    np.testing.assert_allclose(found.readings_mm, table, atol=1e-4)
    assert "lengths are in m" in found.decisions[0]


def test_x3p_packed_with_its_folder(tmp_path, shared_dir):
    source = shared_dir / "real" / "roughness" / "x3p-2.x3p"
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(tmp_path / "a.x3p", "w") as new:
        for name in old.namelist():
            new.writestr(f"topography/{name}", old.read(name))
    np.testing.assert_array_equal(
        read_height_map(tmp_path / "a.x3p").readings_mm, read_height_map(source).readings_mm
    )


# ------------------------------------------------------------------------------ rays and motion


def test_rays_of_an_unrectified_instrument_see_the_points_where_they_were(tmp_path):
    rng = np.random.default_rng(2)
    slope = (np.arange(40) - 19.5) * 0.004
    heights = 20.0 + (np.arange(20) >= 8)[:, None] + 0.01 * rng.normal(size=(20, 40))
    x = slope * (120.0 - heights)
    lines = ["y_mm,x_mm,z_mm"]
    for r in range(20):
        lines += [f"{0.2 * r:.3f},{x[r, c]:.6f},{heights[r, c]:.6f}" for c in range(40)]
    (tmp_path / "a.csv").write_text("\n".join(lines))
    done = convert(read_height_map(tmp_path / "a.csv"), Setup(name="a"))
    done.recording.save(tmp_path / "a.h5")
    recording = Recording.load(tmp_path / "a.h5")
    assert recording.x_mm is None
    from sensors.casting.laser import Laser

    points = Laser.of_recording(done.sensor, recording).points_mm(recording.depth_mm)
    ones = np.ones((*points.shape[:2], 1))
    there = np.einsum("rij,rpj->rpi", recording.poses, np.concatenate([points, ones], axis=2))
    np.testing.assert_allclose(there[..., 0], x, atol=2e-4)
    np.testing.assert_allclose(there[..., 2], heights, atol=1e-5)


@pytest.mark.parametrize("kind", ["quaternion", "wpr", "abc", "rotvec", "matrix"])
def test_poses_in_every_convention_are_the_same_poses(tmp_path, kind):
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_euler("xyz", [[175.0, 3.0, -4.0], [178.0, -2.0, 10.0]], degrees=True)
    place = np.array([[1.0, 2.0, 300.0], [1.5, 2.5, 301.0]])
    wpr = turn.as_euler("xyz", degrees=True)
    columns = {
        "quaternion": ("qx,qy,qz,qw", turn.as_quat()), "wpr": ("w,p,r", wpr),
        "abc": ("a,b,c", wpr[:, ::-1]), "rotvec": ("rx,ry,rz", turn.as_rotvec()),
        "matrix": ("", None),
    }[kind]  # fmt: skip
    path = tmp_path / "poses.csv"
    if kind == "matrix":
        full = np.tile(np.eye(4), (2, 1, 1))
        full[:, :3, :3], full[:, :3, 3] = turn.as_matrix(), place
        np.savetxt(path, full.reshape(2, 16), "%.12g", ",")
    else:
        table = np.column_stack([place, columns[1]])
        np.savetxt(path, table, "%.12g", ",", header=f"x_mm,y_mm,z_mm,{columns[0]}", comments="")
    poses = read_poses(path)
    np.testing.assert_allclose(poses[:, :3, :3], turn.as_matrix(), atol=1e-9)
    np.testing.assert_allclose(poses[:, :3, 3], place)


def test_poses_of_an_unstated_convention_are_refused(tmp_path):
    (tmp_path / "p.csv").write_text("x,y,z,u,v,t\n1,2,3,4,5,6\n")
    with pytest.raises(RecipeError, match="in a convention that its column names .*FANUC"):
        read_poses(tmp_path / "p.csv")
    (tmp_path / "q.csv").write_text("x,y,z,qw,qx,qy,qz\n1,2,3,2,0,0,0\n")
    with pytest.raises(RecipeError, match="not of length 1"):
        read_poses(tmp_path / "q.csv")


def test_rows_by_place_count_and_time(tmp_path):
    lines = "".join(f"{7 * k},{2 * k}\n" for k in range(5))
    (tmp_path / "r.csv").write_text("encoder,time_ms\n" + lines)
    rows = read_rows(tmp_path / "r.csv")
    assert rows.counts
    np.testing.assert_allclose(rows.time_s, 0.002 * np.arange(5))
    from sensors.formats.height_map import HeightMap

    heights = HeightMap(readings_mm=plate(5, 30), x_mm=np.arange(30.0))
    with pytest.raises(RecipeError, match="--pitch-y-mm"):
        convert(heights, Setup(name="a", rows=rows))
    done = convert(heights, Setup(name="a", rows=rows, pitch_y_mm=0.3, start_time_s=40.0))
    np.testing.assert_allclose(done.recording.poses[:, 1, 3], 0.3 * np.arange(5))
    assert done.sensor.profile_rate_hz == 500.0
    assert done.recording.start_time_s == 40.0
    (tmp_path / "y.csv").write_text("0\n1\n3\n4\n9\n")
    done = convert(heights, Setup(name="a", rows=read_rows(tmp_path / "y.csv")))
    np.testing.assert_allclose(done.recording.poses[:, 1, 3], [0, 1, 3, 4, 9])


def test_flipped_columns_run_against_x():
    from sensors.formats.height_map import HeightMap

    heights = HeightMap(readings_mm=plate(), x_mm=0.2 * np.arange(30))
    done = convert(heights, Setup(name="a", pitch_y_mm=0.2, flip_x=True))
    np.testing.assert_allclose(done.recording.x_mm, -0.2 * np.arange(30))
