"""Files as a stranger gets them: recordings, datasheet, part."""

import struct
from pathlib import Path as FilePath
from typing import Any

import h5py
import numpy as np
import yaml
from numpy.typing import NDArray

from challenge.instrument.instrument import Instrument, Path, Solid

OPTIONAL = ("line_width_um", "wavelength_nm", "exposure_s", "camera_rows", "repeatability_um")
"""Keys that a maker's file may leave out; about half of them are, but for the first family."""


def write_recording(
    file: FilePath,
    depth_mm: NDArray[np.float32],
    intensity: NDArray[np.float32],
    path: Path,
    name: str,
    x_mm: NDArray[np.float64] | None = None,
) -> None:
    """Write recording.h5: commanded poses, encoder times, readings."""
    time = np.arange(path.profiles) / path.rate_hz
    write_delivered(file, depth_mm, intensity, path.poses(), time, path.start_s, name, x_mm=x_mm)


def write_delivered(
    file: FilePath,
    depth_mm: NDArray[np.float32],
    intensity: NDArray[np.float32],
    poses: NDArray[np.float64],
    time_s: NDArray[np.float64],
    start_s: float,
    name: str,
    *,
    x_mm: NDArray[np.float64] | None = None,
) -> None:
    """Write recording.h5 of any instrument; a rectifying one states its columns' x."""
    with h5py.File(file, "w") as out:
        out.attrs["format"] = "profilometer-recording"
        out.attrs["version"] = 1
        out.attrs["name"] = name
        out.attrs["comment"] = ""
        out.attrs["start_time_s"] = float(start_s)
        out["depth"] = depth_mm
        out["intensity"] = intensity
        out["pose"] = poses
        out["time"] = time_s
        if x_mm is not None:
            out["x"] = x_mm


def write_stl(file: FilePath, solid: Solid) -> None:
    """Write a binary STL in mm."""
    corners = solid.vertices_mm[solid.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    record = np.zeros(
        len(corners), np.dtype([("n", "<f4", 3), ("v", "<f4", (3, 3)), ("pad", "<u2")])
    )
    record["n"] = normal / np.where(length > 0, length, 1)
    record["v"] = corners
    with file.open("wb") as out:
        out.write(b"part".ljust(80, b" "))
        out.write(struct.pack("<I", len(corners)))
        out.write(record.tobytes())


def read_stl(file: FilePath) -> Solid:
    """Read a binary STL in mm, triangle by triangle."""
    data = file.read_bytes()
    count = struct.unpack("<I", data[80:84])[0]
    kind = np.dtype([("n", "<f4", 3), ("v", "<f4", (3, 3)), ("pad", "<u2")])
    corners = np.frombuffer(data, kind, count, 84)["v"].astype(np.float64)
    return Solid(
        vertices_mm=corners.reshape(-1, 3), faces=np.arange(3 * count).reshape(-1, 3)
    )


def datasheet(
    device: Instrument, path: Path, effects: list[dict[str, Any]], repeatability_um: float
) -> dict[str, Any]:
    """Nominal datasheet of an instrument, as its maker prints it."""
    camera, sheet = device.camera, device.sheet
    half = np.tan(camera.fov_rad / 2)
    depths = camera.working_distance_mm + np.array([-0.5, 0.5]) * device.z_range_mm
    ends = camera.row_of(np.zeros(2), np.zeros(2), depths)  # rows over the working range
    return {
        "name": "profilometer",
        "working_distance_mm": float(camera.working_distance_mm),
        "z_range_mm": float(device.z_range_mm),
        "x_fov_mm": float(2 * camera.working_distance_mm * half),
        "points_per_profile": int(camera.columns),
        "z_resolution_um": float(round(device.step_mm * 1e3, 6)),
        "repeatability_um": float(repeatability_um),
        "profile_rate_hz": float(path.rate_hz),
        "travel_speed_mm_s": float(path.pitch_mm * path.rate_hz),
        "columns": "even_angle",
        "triangulation_angle_deg": float(np.degrees(camera.triangulation_rad)),
        "camera_side": "+y" if camera.side > 0 else "-y",
        "line_width_um": float(round(4e3 * sheet.waist_mm, 3)),
        "wavelength_nm": float(sheet.wavelength_mm * 1e6),
        "exposure_s": float(sheet.exposure_s),
        "camera_rows": int(round(float(ends[1] - ends[0]))),
        "effects": effects,
    }


def write_yaml(file: FilePath, data: dict[str, Any]) -> None:
    """Write plain YAML in the order given."""
    file.write_text(yaml.safe_dump(data, sort_keys=False))
