"""Tables of text, layout by layout: what instruments write, and neighbours of each kind."""

import io

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from files.errors import RecipeError
from sensors.formats import read_height_map
from sensors.formats.text.axes import without_axes
from sensors.formats.text.cells import split
from sensors.formats.text.decode import decoded
from sensors.formats.text.headers import read_header
from sensors.formats.text.names import role_of
from sensors.formats.units import length_in, time_in
from tests.support.instrument_files import plate

QUICK = settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def text(table, separator=",", decimal=".", missing="nan", form="%.4f", trailing=False):
    lines = []
    for row in table:
        cells = [missing if np.isnan(v) else (form % v).replace(".", decimal) for v in row]
        lines.append(separator.join(cells) + (separator if trailing else ""))
    return "\n".join(lines) + "\n"


@QUICK
@given(
    separator=st.sampled_from([",", ";", "\t", " ", "  ", ", "]),
    decimal=st.sampled_from([".", ","]),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "latin-1"]),
    newline=st.sampled_from(["\n", "\r\n"]),
    missing=st.sampled_from(["nan", "NaN", "", "---", "N/A"]),
    trailing=st.booleans(),
    header=st.booleans(),
    seed=st.integers(0, 5),
)
def test_a_matrix_in_any_dress_is_the_same_matrix(
    tmp_path, separator, decimal, encoding, newline, missing, trailing, header, seed
):
    if decimal == "," and separator.strip() == ",":
        decimal = "."
    if separator.isspace() and separator != "\t":
        missing, trailing = missing or "nan", False
    table = plate(seed=seed)
    table[3, 4] = table[5, -1] = np.nan
    words = text(table, separator, decimal, missing, trailing=trailing)
    if header:
        words = "height of the part\n\n" + words
    path = tmp_path / "a.csv"
    path.write_bytes(words.replace("\n", newline).encode(encoding))
    found = read_height_map(path)
    np.testing.assert_array_equal(found.readings_mm, table)
    assert found.x_mm is None


@QUICK
@given(
    first=st.sampled_from([0.0, -9.0, 3.25]),
    step=st.sampled_from([0.1, 0.3, 1.0]),
    corner=st.sampled_from(["0", "", "Y\\X", "y/x", "nan"]),
    falling=st.booleans(),
)
def test_axes_in_the_first_row_and_column_are_no_readings(tmp_path, first, step, corner, falling):
    table = plate()
    x = first + step * np.arange(table.shape[1])
    y = first + 2 * step * np.arange(table.shape[0])
    y = y[::-1] if falling else y
    lines = [",".join([corner, *(f"{v:.4f}" for v in x)])]
    lines += [",".join([f"{b:.4f}", *(f"{v:.4f}" for v in row)])
              for b, row in zip(y, table, strict=True)]  # fmt: skip
    path = tmp_path / "a.csv"
    path.write_text("\n".join(lines))
    found = read_height_map(path)
    np.testing.assert_array_equal(found.readings_mm, table)
    np.testing.assert_allclose(found.x_mm, x, atol=1e-4)
    np.testing.assert_allclose(found.y_mm, y, atol=1e-4)
    assert "the first row and column are axes" in found.decisions


def test_a_tilted_plane_without_axes_keeps_all_its_rows():
    x, y = np.meshgrid(np.arange(30) * 0.1, np.arange(24) * 0.2)
    plane = np.round(5.0 + 0.3 * x + 0.1 * y, 6)
    axes = without_axes(plane)
    assert axes.dropped == ()
    np.testing.assert_array_equal(axes.table, plane)
    noisy = plane + np.random.default_rng(1).normal(0, 1e-3, plane.shape)
    assert without_axes(noisy).dropped == ()


@pytest.mark.parametrize(
    "names", ["frame,timestamp_us,encoder", "No.;Time [ms];Enc", "profile_id,t_s"]
)
def test_leading_columns_are_told_by_their_names(tmp_path, names):
    separator = ";" if ";" in names else ","
    table = plate()
    keys = names.split(separator)
    lead = [np.arange(len(table)), 2.0 * np.arange(len(table)), 17 * np.arange(len(table))]
    full = np.column_stack([*lead[: len(keys)], table])
    heads = separator.join([names, *(f"z{k}" for k in range(table.shape[1]))])
    path = tmp_path / "a.csv"
    path.write_text(heads + "\n" + text(full, separator))
    found = read_height_map(path)
    np.testing.assert_array_equal(found.readings_mm, table)
    second = {"timestamp_us": 1e-6, "Time [ms]": 1e-3, "t_s": 1.0}[keys[1]]
    np.testing.assert_allclose(found.time_s, 2.0 * second * np.arange(len(table)))
    if len(keys) == 3:
        assert found.row_counts
        np.testing.assert_array_equal(found.y_mm, lead[2])


def test_names_that_are_numbers_are_places_of_the_columns(tmp_path):
    table = plate()
    heads = ",".join(["y_mm", *(f"{0.2 * k:.1f}" for k in range(table.shape[1]))])
    full = np.column_stack([0.5 * np.arange(len(table)), table])
    (tmp_path / "a.csv").write_text(heads + "\n" + text(full))
    found = read_height_map(tmp_path / "a.csv")
    np.testing.assert_array_equal(found.readings_mm, table)
    np.testing.assert_allclose(found.x_mm, 0.2 * np.arange(table.shape[1]))
    np.testing.assert_allclose(found.y_mm, 0.5 * np.arange(len(table)))


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("z_um", "um"), ("x (mm)", "mm"), ("X_(microns)", "microns"), ("y in µm", "µm"),
        ("Lateral um", "um"), ("Width [nm]", "nm"), ("12.3 µm", "µm"), ("height/mm", "mm"),
        ("x", None), ("s", None), ("Distance m", "m"), ("z [m]", "m"), ("name", None),
    ],
)  # fmt: skip
def test_units_in_names(name, unit):
    assert length_in(name) == unit


def test_times_and_roles_in_names():
    assert time_in("timestamp_us") == 1e-6
    assert time_in("Time [ms]") == 1e-3
    assert time_in("time") is None
    names = ("x_mm", "Height (um)", "Frame", "enc", "z17", "Intensity")
    roles = ["x", "z", "counter", "encoder", "z", "brightness"]
    assert [role_of(name) for name in names] == roles
    assert role_of("car") is None


def test_headers_of_gwyddion_in_two_languages():
    for width, height, units in (
        ("Width", "Height", "Value units"), ("Breite", "Höhe", "Werteinheiten"),
    ):  # fmt: skip
        head = read_header([f"# {width}: 12.34 µm", f"# {height}: 5678.9 nm", f"# {units}: m"])
        assert head.width_mm == pytest.approx(12.34e-3)
        assert head.height_mm == pytest.approx(5678.9e-6)
        assert head.unit == "m"


def test_one_unit_in_the_header_holds_for_both(tmp_path):
    rows = "\n".join(f"{0.5 * k:.1f},{np.sin(k):.5f}" for k in range(20))
    (tmp_path / "a.csv").write_text("X_(microns),y1\n" + rows)
    found = read_height_map(tmp_path / "a.csv")
    np.testing.assert_allclose(found.x_mm, 0.0005 * np.arange(20))
    np.testing.assert_allclose(found.readings_mm[0], 1e-3 * np.sin(np.arange(20)), atol=1e-8)
    assert "microns" in found.decisions[0]
    other = read_height_map(tmp_path / "a.csv", "mm")
    np.testing.assert_allclose(other.readings_mm, 1e3 * found.readings_mm)


def test_a_unit_that_the_user_contradicts_is_said(tmp_path):
    rows = "\n".join(f"{0.1 * k:.1f},{k % 5}" for k in range(20))
    (tmp_path / "a.csv").write_text("x_mm,z_um\n" + rows)
    found = read_height_map(tmp_path / "a.csv", "mm")
    assert found.decisions == ("the file says that heights are in um; taken as mm, as given",)
    assert found.readings_mm.max() == 4.0


@pytest.mark.parametrize("emitter", [120.0, -80.0])
@pytest.mark.parametrize("share", [1.0, 0.9])
def test_unrectified_profiles_keep_the_rays_of_their_columns(tmp_path, emitter, share):
    """Points lie on their rays to the digits printed; nothing is moved to another grid."""
    rng = np.random.default_rng(3)
    columns, rows = 50, 30
    slope = (np.arange(columns) - 24.5) * 0.4 / (20.0 - emitter)
    heights = 20.0 + (np.arange(rows) >= 12)[:, None] + 0.01 * rng.normal(size=(rows, columns))
    x = 1.5 + slope * (heights - emitter)
    keep = rng.uniform(size=heights.shape) < share
    lines = ["y_mm,x_mm,z_mm"]
    for r in range(rows):
        lines += [f"{0.2 * r:.4f},{x[r, c]:.4f},{heights[r, c]:.4f}"
                  for c in range(columns) if keep[r, c]]  # fmt: skip
    (tmp_path / "a.csv").write_text("\n".join(lines))
    found = read_height_map(tmp_path / "a.csv")
    assert found.readings_mm.shape == (rows, columns)
    np.testing.assert_array_equal(np.isnan(found.readings_mm), ~keep)
    seen = found.x_mm + found.slope_x * found.readings_mm
    np.testing.assert_allclose(seen[keep], x[keep], atol=5e-4)
    np.testing.assert_allclose(found.slope_x, slope, rtol=0.02, atol=2e-5)


def test_points_anywhere_are_refused(tmp_path):
    points = np.random.default_rng(0).uniform(0, 10, (400, 3))
    np.savetxt(tmp_path / "a.xyz", points, "%.5f")
    with pytest.raises(RecipeError, match="nothing is resampled"):
        read_height_map(tmp_path / "a.xyz")


@QUICK
@given(order=st.permutations(["x_mm", "y_mm", "z_mm", "intensity"]), origin=st.booleans())
def test_points_in_any_order_of_columns(tmp_path, order, origin):
    table = plate(12, 16)
    y, x = np.meshgrid(0.5 * np.arange(12), 0.2 * np.arange(16), indexing="ij")
    gone = np.zeros(table.shape, bool)
    gone[2, 3] = gone[4, 5] = gone[7, 7] = True
    columns = {"x_mm": x, "y_mm": y, "z_mm": table, "intensity": 100 + 0 * x}
    if origin:
        columns = {key: np.where(gone, 0.0, value) for key, value in columns.items()}
    chosen = np.ones(table.shape, bool) if origin else ~gone
    full = np.column_stack([columns[key][chosen] for key in order])
    (tmp_path / "a.csv").write_text(",".join(order) + "\n" + text(full))
    found = read_height_map(tmp_path / "a.csv")
    np.testing.assert_array_equal(np.isnan(found.readings_mm), gone)
    np.testing.assert_array_equal(found.readings_mm[~gone], table[~gone])
    assert (len(found.decisions) > 1) == origin


def test_decoding_without_a_mark():
    for encoding in ("utf-16-le", "utf-16-be", "utf-8", "latin-1"):
        assert decoded("x in µm;1\n".encode(encoding)) == "x in µm;1\n"


def test_a_named_empty_last_column_stays():
    cells = split(["a,b,c", "1,2,", "3,4,"])
    assert not cells.trailing
    assert cells.rows[1] == ["1", "2", ""]


def test_a_line_with_the_count_is_no_reading(tmp_path):
    rows = "\n".join(f" {1.5 * k:.4e},   {17 + np.sin(k):.4e}" for k in range(23))
    (tmp_path / "a.txt").write_text("µm µm\n23\n" + rows, encoding="utf-8")
    found = read_height_map(tmp_path / "a.txt")
    assert found.readings_mm.shape == (1, 23)
    assert found.x_mm[1] == pytest.approx(1.5e-3)


def test_gocator_export(tmp_path):
    table = plate(10, 12)
    table[4, 4] = np.nan
    out = io.StringIO()
    out.write("Info\nVersion,ZResolution,Layout\n2,0.003,0\nEnd\n\nPart\nFrame,Row Count,Columns\n")
    out.write("1,10,12\n" + ",".join(["Y\\X", *(f"{-3 + 0.3 * k:.5f}" for k in range(12))]) + "\n")
    for r, row in enumerate(table):
        cells = ["" if np.isnan(v) else f"{v:.5f}" for v in row]
        out.write(",".join([f"{0.5 * r:.5f}", *cells]) + "\n")
    out.write("End\n")
    (tmp_path / "a.csv").write_text(out.getvalue())
    found = read_height_map(tmp_path / "a.csv")
    np.testing.assert_array_equal(found.readings_mm, table)
    np.testing.assert_allclose(found.x_mm, -3 + 0.3 * np.arange(12))
    np.testing.assert_allclose(found.y_mm, 0.5 * np.arange(10))
    assert found.step_mm == 0.003
