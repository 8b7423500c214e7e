"""Where the sensor was: poses of a robot, places and times of rows, from CSV files."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from files.errors import RecipeError
from sensors.formats.height_map import Floats, scale_mm
from sensors.formats.text.cells import number, split
from sensors.formats.text.decode import decoded
from sensors.formats.text.names import role_of
from sensors.formats.units import length_in, time_in

CONVENTIONS = {
    "quaternion": "x,y,z,qw,qx,qy,qz (by name, in any order)",
    "matrix": "12 or 16 numbers, the rows of [R t] one after another",
    "wpr": "x,y,z,w,p,r in degrees, R = Rz(r) Ry(p) Rx(w) (FANUC, Yaskawa)",
    "abc": "x,y,z,a,b,c in degrees, R = Rz(a) Ry(b) Rx(c) (KUKA)",
    "rotvec": "x,y,z,rx,ry,rz in radians, a rotation vector (Universal Robots)",
}
_EULER = {"wpr": ("w", "p", "r"), "abc": ("c", "b", "a")}


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Rows:
    """What a file states for each row.

    Attributes
    ----------
    y_mm : (n,) or None
        Places along the travel, mm; or counts of an encoder, where `counts`.
    time_s : (n,) or None
    counts : bool
    """

    y_mm: Floats | None
    time_s: Floats | None
    counts: bool


def read_rows(path: Path) -> Rows:
    """Read a place, an encoder's count or a time for each row.

    A column named `y` or `y_mm` holds places, `encoder` counts, `time_s`, `timestamp_us` times; a
    file of one column without a name holds places in mm.
    """
    names, table = _columns(path)
    roles = [role_of(name) for name in names]
    if not names and table.shape[1] == 1:
        return Rows(y_mm=table[:, 0], time_s=None, counts=False)
    place = next((k for k, role in enumerate(roles) if role == "y"), None)
    encoder = next((k for k, role in enumerate(roles) if role == "encoder"), None)
    time = next((k for k, role in enumerate(roles) if role == "time"), None)
    if place is None and encoder is None and time is None:
        raise RecipeError(
            "names no column of places, counts or times", where=path, value=", ".join(names),
            allowed="y_mm, encoder, time_s",
        )  # fmt: skip
    y = None
    if place is not None:
        y = table[:, place] * scale_mm(None, length_in(names[place]))
    elif encoder is not None:
        y = table[:, encoder]
    seconds = None
    if time is not None:
        unit = time_in(names[time])
        if unit is None:
            raise RecipeError(
                f"column {names[time]!r} names no unit", where=path, allowed="time_s, time_ms, ..."
            )
        seconds = (table[:, time] - table[0, time]) * unit
    return Rows(y_mm=y, time_s=seconds, counts=place is None and encoder is not None)


def read_poses(path: Path, convention: str | None = None) -> Floats:
    """Read a pose (n, 4, 4), sensor to part, mm, for each row.

    Parameters
    ----------
    path
        A CSV with a row of names.
    convention
        A key of `CONVENTIONS`; None: by the columns' names.

    Raises
    ------
    RecipeError
        Where neither names nor convention fit the columns.
    """
    names, table = _columns(path)
    lower = [name.lower() for name in names]
    base = [name.split("_")[0].split("[")[0].split("(")[0].strip() for name in lower]
    kind = convention or _convention(base, table.shape[1])
    if kind is None:
        raise RecipeError(
            "holds poses in a convention that its column names do not state", where=path,
            value=", ".join(names) or f"{table.shape[1]} columns",
            allowed="; ".join(f"{key}: {words}" for key, words in CONVENTIONS.items()),
        )  # fmt: skip
    if kind == "matrix":
        return _matrices(table, path)
    poses = np.tile(np.eye(4), (len(table), 1, 1))
    keys = {"quaternion": ("qw", "qx", "qy", "qz"), "rotvec": ("rx", "ry", "rz")}.get(
        kind, _EULER.get(kind, ())
    )
    places = [_find(base, axis, k, path) for k, axis in enumerate("xyz")]
    unit = length_in(names[places[0]]) if names else None
    poses[:, :3, 3] = table[:, places] * scale_mm(None, unit)
    angles = table[:, [_find(base, key, 3 + k, path) for k, key in enumerate(keys)]]
    if kind == "quaternion":
        size = np.linalg.norm(angles, axis=1)
        if (np.abs(size - 1) > 0.01).any():
            row = int(np.argmax(np.abs(size - 1)))
            raise RecipeError("has a quaternion not of length 1", where=path, value=size[row])
        turn = Rotation.from_quat(angles[:, [1, 2, 3, 0]])
    elif kind == "rotvec":
        turn = Rotation.from_rotvec(angles)
    else:
        turn = Rotation.from_euler("xyz", angles, degrees=True)
    poses[:, :3, :3] = turn.as_matrix()
    return poses


def _convention(base: list[str], columns: int) -> str | None:
    held = set(base)
    for kind, keys in (
        ("quaternion", {"qw", "qx", "qy", "qz"}), ("rotvec", {"rx", "ry", "rz"}),
        ("wpr", {"w", "p", "r"}), ("abc", {"a", "b", "c"}),
    ):  # fmt: skip
        if keys <= held:
            return kind
    return "matrix" if columns in (12, 16) else None


def _find(base: list[str], key: str, otherwise: int, path: Path) -> int:
    if not base:
        return otherwise
    if key not in base:
        raise RecipeError(f"has no column {key!r}", where=path, value=", ".join(base))
    return base.index(key)


def _matrices(table: Floats, path: Path) -> Floats:
    if table.shape[1] not in (12, 16):
        raise RecipeError(
            "holds no matrices", where=path, value=f"{table.shape[1]} columns", allowed="12 or 16"
        )
    poses = np.tile(np.eye(4), (len(table), 1, 1))
    poses[:, : table.shape[1] // 4] = table.reshape(len(table), -1, 4)
    return poses


def _columns(path: Path) -> tuple[list[str], Floats]:
    """Return names (or none) and numbers of a CSV file."""
    if not path.is_file():
        raise RecipeError("no such file", where=path)
    try:
        lines = decoded(path.read_bytes()).splitlines()
    except OSError as error:
        raise RecipeError(f"can't be read ({error.strerror or error})", where=path) from None
    filled = [line for line in lines if line.strip()]
    if not filled:
        raise RecipeError("is empty", where=path)
    rows = split(filled).rows
    names: list[str] = []
    if any(number(cell) is None for cell in rows[0]):
        names, rows = [cell.lstrip("# ").strip() for cell in rows[0]], rows[1:]
    values: list[list[float]] = []
    for k, row in enumerate(rows, start=2 if names else 1):
        numbers = [number(cell) for cell in row]
        if None in numbers or len(row) != len(rows[0]):
            raise RecipeError("isn't a row of numbers", where=f"{path}:{k}")
        values.append([value for value in numbers if value is not None])
    table = np.array(values, np.float64)
    if not table.size or not np.isfinite(table).all():
        raise RecipeError("holds rows without a number", where=path)
    if names and len(names) != table.shape[1]:
        raise RecipeError(
            "has another number of names than columns", where=path, value=len(names),
            allowed=str(table.shape[1]),
        )  # fmt: skip
    return names, table
