"""The maker's edge artefact: steps, a roof and a groove, scanned to state what edges do.

The laws a file can list are simpler than the optics. The maker scans an artefact of known
edges with the instrument itself and states those widths, that merging distance and that
shadow's threshold with which the listed laws come nearest to the readings' means.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from challenge.cases.stated import Rays, stated
from challenge.instrument.instrument import Casts, Instrument, Path, Solid
from challenge.instrument.optical_surface import OpticalSurface

_STEPS_MM = (0.3, 0.6, 1.5)
_LAND_MM = 0.7
_SPECIMENS = 6
_TURN_RAD = 0.07  # edges cross the profiles slowly: every place between two profiles occurs
_CUT = 5.0  # beyond so many σ a departure counts no more: a wrong level is a wrong level


def artefact() -> tuple[Solid, float]:
    """Build steps of three heights, a roof and a groove along x; and their length, mm."""
    outline = [(-30.0, 0.0), (_LAND_MM, 0.0)]

    def go(run: float, rise: float) -> None:
        outline.append((outline[-1][0] + run, outline[-1][1] + rise))

    for height in _STEPS_MM:
        for rise in (height, -height):
            go(0.002, rise)
            go(_LAND_MM, 0.0)
    for rise in (0.6, -0.6, 0.0, -0.6, 0.6):
        go(0.7, rise)
    go(_LAND_MM, 0.0)
    length = outline[-1][0]
    outline.append((length + 30.0, 0.0))
    y, z = np.array(outline).T
    y = y - length / 2
    near = np.stack([np.full(y.size, -60.0), y, z], 1)
    far = np.stack([np.full(y.size, 60.0), y, z], 1)
    i = np.arange(y.size - 1)
    faces = np.concatenate(
        [
            np.stack([i, i + y.size, i + 1], 1),
            np.stack([i + 1, i + y.size, i + y.size + 1], 1),
        ]
    )
    return Solid(vertices_mm=np.concatenate([near, far]), faces=faces), length


@dataclass(frozen=True, kw_only=True, slots=True)
class EdgeFigures:
    """What the maker states of edges.

    Attributes
    ----------
    spot_um, mixing_um
        Spread of the line that rounds ridges best, and that mixes levels best.
    merge_um
        Depth between two images up to which they are read as one.
    weakest
        Share of the line's light with which a reading is returned.
    """

    spot_um: float
    mixing_um: float
    merge_um: float
    weakest: float

    def entries(self, device: Instrument, along_um: float) -> list[dict[str, Any]]:
        """Return the file's `camera_occlusion`, `finite_spot` and `edge_mixing`."""
        camera = device.camera
        rayleigh = round(device.sheet.rayleigh_mm, 2)
        return [
            {
                "name": "camera_occlusion",
                "triangulation_angle_deg": round(float(np.degrees(camera.triangulation_rad)), 6),
                "camera_side": "+y" if camera.side > 0 else "-y",
                "line_sd_um": round(1e3 * device.sheet.waist_mm, 3),
                "weakest": round(self.weakest, 4),
            },
            {
                "name": "finite_spot",
                "line_sd_um": round(self.spot_um, 2),
                "along_um": round(along_um, 2),
                "rayleigh_mm": rayleigh,
            },
            {
                "name": "edge_mixing",
                "line_sd_um": round(self.mixing_um, 2),
                "merge_um": round(self.merge_um, 1),
                "weakest": round(self.weakest, 4),
                "rayleigh_mm": rayleigh,
            },
        ]


def edge_figures(device: Instrument, rng: np.random.Generator, *, along_um: float) -> EdgeFigures:
    """Scan the artefact and choose the figures, one after the other.

    Parameters
    ----------
    device
        The well-made, calibrated instrument, standing still.
    along_um
        Footprint along the line, which ordinary resolution charts tell.
    """
    camera, sheet = device.camera, device.sheet
    solid, length = artefact()
    turn = (
        Rotation.from_euler("x", 180, degrees=True) * Rotation.from_rotvec([0, 0, _TURN_RAD])
    ).as_matrix()
    pitch = 2.3 * sheet.waist_mm
    profiles = int(np.ceil(length / pitch))
    start = np.eye(4)
    start[:3, :3] = turn
    middle = np.array([0.0, pitch * (profiles - 1) / 2, camera.working_distance_mm])
    start[:3, 3] = np.array([0.0, 0.0, 0.3]) - turn @ middle
    path = Path(
        start=start, direction=1, profiles=profiles, pitch_mm=pitch, rate_hz=100.0, start_s=0.0
    )
    casts: Casts = {}
    every = 4
    shots = np.stack(
        [
            device.scan(
                solid, OpticalSurface(), path, rng, specimen=int(rng.integers(2**31)), casts=casts
            )[0][:, ::every]
            for _ in range(_SPECIMENS)
        ]
    ).astype(np.float64)  # fmt: skip
    rays = Rays(solid, path, np.eye(4), camera, device.z_range_mm, columns=every)
    seen = np.isfinite(shots).mean(0)
    mean = np.nansum(shots, 0) / np.maximum(np.isfinite(shots).sum(0), 1)
    mean = np.where(seen > 0, mean, np.nan)
    bare, _ = rays.at()
    with np.errstate(invalid="ignore"):
        sigma = 1.4826 * float(np.nanmedian(np.abs(shots - mean))) / np.sqrt(1 - 1 / _SPECIMENS)
    shift = float(np.nanmedian(mean - bare))

    def far_off(figures: EdgeFigures) -> tuple[float, float]:
        """Mean square departure in σ², cut; and share of points wrongly said to (not) return."""
        said = stated(rays, figures.entries(device, along_um)).depth_mm
        both = np.isfinite(said) & (seen > 0.5)
        rest = np.abs(mean - said - shift)[both] / sigma
        return float(np.mean(np.minimum(rest, _CUT) ** 2)), float(
            np.mean(np.isfinite(said) != (seen > 0.5))
        )

    waist_um = 1e3 * sheet.waist_mm
    grain = camera.amplitude_spread_mm(sheet.wavelength_mm) / np.sqrt(2)
    blur = np.hypot(sheet.waist_mm * np.cos(camera.triangulation_rad), grain)
    touch = 2 * blur * np.sqrt(2 * np.log(camera.fill / device.finder.threshold))
    merge_um = 1e3 * touch / np.sin(camera.triangulation_rad)
    merges: NDArray[np.float64] = merge_um * np.array([0.4, 0.6, 0.8, 1.0, 1.3])
    if device.finder.kind == "gravity_all":  # everything in a column is one image
        merge_um, merges = 1e3 * device.z_range_mm, np.zeros(0)

    def best(tried: list[EdgeFigures], judge: int) -> EdgeFigures:
        return min(tried, key=lambda figures: far_off(figures)[judge])

    def made(spot: float, mixing: float, merge: float, weakest: float) -> EdgeFigures:
        return EdgeFigures(spot_um=spot, mixing_um=mixing, merge_um=merge, weakest=weakest)

    now = made(1.3 * waist_um, 0.8 * waist_um, merge_um, 0.05)
    now = best([made(now.spot_um, now.mixing_um, now.merge_um, w)
                for w in (0.005, 0.01, 0.02, 0.035, 0.05, 0.08, 0.12, 0.2)], 1)  # fmt: skip
    for _ in range(2):
        now = best([made(f * waist_um, now.mixing_um, now.merge_um, now.weakest)
                    for f in (0.8, 1.0, 1.2, 1.4, 1.6, 1.8)], 0)  # fmt: skip
        now = best([made(now.spot_um, f * waist_um, now.merge_um, now.weakest)
                    for f in (0.4, 0.55, 0.7, 0.85, 1.0, 1.2)], 0)  # fmt: skip
        if len(merges):
            now = best([made(now.spot_um, now.mixing_um, float(m), now.weakest)
                        for m in merges], 0)  # fmt: skip
    return now

