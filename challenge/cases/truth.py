"""What a case's effect does, seen with other speckle: for the judge."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, uniform_filter
from scipy.stats import ks_2samp

from challenge.cases.case import Secret, Staged, scan
from challenge.cases.seeds import child, number
from challenge.cases.switches import World
from challenge.instrument.instrument import Casts, Path
from challenge.instrument.rays import plant
from challenge.instrument.stripes import first_hits


@dataclass(frozen=True, kw_only=True, slots=True)
class Geometry:
    """What rays alone say: depth (n, m), visible, smooth (away from every edge)."""

    depth_mm: NDArray[np.float64]
    visible: NDArray[np.bool_]
    smooth: NDArray[np.bool_]


def geometry(world: World, path: Path, misplaced: NDArray[np.float64]) -> Geometry:
    """Cast the nominal rays of one scan at the part as it truly lay."""
    to_sensor = np.linalg.inv(misplaced @ path.start)
    vertices = world.solid.vertices_mm @ to_sensor[:3, :3].T + to_sensor[:3, 3]
    camera = world.device.camera
    y = path.direction * path.pitch_mm * np.arange(path.profiles, dtype=np.float64)
    depth, normal, visible = first_hits(plant(vertices, world.solid.faces), y, camera)
    # an edge is where a facet's plane misses the neighbours' hits
    with np.errstate(invalid="ignore", divide="ignore"):
        slope_x, slope_y = -normal[..., 0] / normal[..., 2], -normal[..., 1] / normal[..., 2]
    x = depth * np.tan(camera.angles_rad())
    edge = ~visible | ~np.isfinite(depth)
    for axis in (0, 1):
        for step in (-1, 1):
            dx, dz = np.roll(x, step, axis) - x, np.roll(depth, step, axis) - depth
            dy = (np.roll(y, step) - y)[:, None] if axis == 0 else 0.0
            miss = np.abs(dz - slope_x * dx - slope_y * dy)
            miss[(0, -1), :] = 0
            miss[:, (0, -1)] = 0
            edge |= ~(miss < 0.01)
    reach = int(np.ceil(4 * world.device.sheet.waist_mm / path.pitch_mm)) + 2
    edge = binary_dilation(edge, np.ones((2 * reach + 1, 7), bool))
    return Geometry(depth_mm=depth, visible=visible, smooth=~edge)


def _levelled(
    rest: NDArray[np.float64], use: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Take away offset and tilt, which a registration absorbs."""
    rows, columns = np.indices(rest.shape)
    use = use & np.isfinite(rest)
    if use.sum() < 10:
        return rest
    design = np.stack([np.ones(rest.shape), rows / rest.shape[0], columns / rest.shape[1]], -1)
    weight = np.ones(int(use.sum()))
    for _ in range(3):
        found = np.linalg.lstsq(design[use] * weight[:, None], rest[use] * weight, rcond=None)[0]
        left = rest[use] - design[use] @ found
        scale = 1.4826 * np.median(np.abs(left)) + 1e-12
        weight = 1 / np.sqrt(1 + (left / (2.5 * scale)) ** 2)
    return np.asarray(rest - design @ found)


@dataclass(frozen=True, kw_only=True, slots=True)
class Facts:
    """An effect on and off, over independent speckle, in the held-out recording.

    Attributes
    ----------
    on_mm, off_mm : (n, m)
        Mean readings, NaN where most draws have none.
    region : (n, m) bool
        Where the effect matters.
    noise_um, oracle_gain
        σ without the effect; logarithm of the RMS without the effect's model over that with it.
    concealed
        True where the usual checks (roughness within 10 %, KS <= 0.05) see nothing.
    """

    on_mm: NDArray[np.float32]
    off_mm: NDArray[np.float32]
    region: NDArray[np.bool_]
    noise_um: float
    oracle_gain: float
    concealed: bool


def _roughness(rest: NDArray[np.float64]) -> NDArray[np.float64]:
    """Ra, Rq, Rpm, Rvm and peaks of profiles, averaged."""
    rest = rest[np.isfinite(rest).sum(1) > 20]
    rest = rest - np.nanmean(rest, 1, keepdims=True)
    ordered = np.sort(np.where(np.isfinite(rest), rest, 0.0), 1)
    peaks = (rest[:, 1:-1] > rest[:, :-2]) & (rest[:, 1:-1] > rest[:, 2:])
    return np.array(
        [
            np.nanmean(np.abs(rest)),
            np.sqrt(np.nanmean(rest**2)),
            ordered[:, -10:].mean(),
            -ordered[:, :10].mean(),
            peaks.mean(),
        ]
    )


def _mean(shots_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean over the first axis, NaN where at most half of it has a return."""
    seen = np.isfinite(shots_mm).sum(0)
    total = np.nansum(shots_mm, 0) / np.maximum(seen, 1)
    return np.where(seen > shots_mm.shape[0] / 2, total, np.nan)


def _noise_of_mean(
    shots_mm: NDArray[np.float64], use: NDArray[np.bool_], cut_mm: float
) -> float:
    """Mean square of what too few draws leave in their mean, clipped."""
    count = shots_mm.shape[0]
    rest = np.clip(shots_mm - _mean(shots_mm), -cut_mm, cut_mm)[:, use]
    return float(np.nanmean(rest**2) / (count - 1))


def facts(staged: Staged, secret: Secret, *, draws: int = 5) -> Facts:
    """Scan the held-out pose again with other specimens, with and without the effect."""
    last = secret.recordings - 1
    on, off = staged.on, staged.off

    def shots(world: World) -> NDArray[np.float64]:
        casts: Casts = {}
        return np.stack(
            [
                scan(
                    world, world.scans, last,
                    specimen=number(secret.seed, "facts", str(d)),
                    # the same stage phases for every draw and as in the recording
                    rng=child(secret.seed, "noise", "abc"[last]),
                    casts=casts,
                )[0]
                for d in range(draws)
            ]
        ).astype(np.float64)  # fmt: skip

    with_it, without = shots(on), shots(off)
    shown = geometry(off, off.scans.paths[last], off.scans.misplaced[last])
    seen_on, seen_off = np.isfinite(with_it).mean(0), np.isfinite(without).mean(0)
    fill_on, fill_off = _mean(with_it), _mean(without)
    rest = _levelled(without[0] - shown.depth_mm, shown.smooth)
    noise = float(1.4826 * np.nanmedian(np.abs(rest[shown.smooth])))
    change = _levelled(fill_on - fill_off, shown.smooth)
    blocks = uniform_filter(np.nan_to_num(change), 5)
    lost = uniform_filter(np.abs(seen_on - seen_off), 5)
    region = (np.abs(blocks) > 0.3 * noise) | (lost > 0.2)
    # the sealed recording's own specimen against the two means
    real = scan(
        on, on.scans, last, specimen=number(secret.seed, "specimen"),
        rng=child(secret.seed, "noise", "abc"[last]),
    )[0].astype(np.float64)  # fmt: skip
    both = np.isfinite(real) & np.isfinite(fill_on) & np.isfinite(fill_off)
    left_off, left_on = _levelled(real - fill_off, both)[both], (real - fill_on)[both]
    cut = 10 * noise
    ms_off = np.mean(np.clip(left_off, -cut, cut) ** 2) - _noise_of_mean(without, both, cut)
    ms_on = np.mean(np.clip(left_on, -cut, cut) ** 2) - _noise_of_mean(with_it, both, cut)
    one = _levelled(real - shown.depth_mm, shown.smooth)
    two = _levelled(without[1] - shown.depth_mm, shown.smooth)
    one, two = np.where(shown.smooth, one, np.nan), np.where(shown.smooth, two, np.nan)
    scale = np.nanstd(one) / np.nanstd(two)  # the noise is fitted
    ks = ks_2samp(one[np.isfinite(one)], scale * two[np.isfinite(two)]).statistic
    rough = np.abs(_roughness(one) / (scale * _roughness(two) + 1e-12) - 1)
    rough[-1] = abs(_roughness(one)[-1] / _roughness(two)[-1] - 1)
    return Facts(
        on_mm=fill_on.astype(np.float32),
        off_mm=fill_off.astype(np.float32),
        region=region,
        noise_um=1e3 * noise,
        oracle_gain=float(0.5 * np.log(ms_off / ms_on)),
        concealed=bool(ks <= 0.05 and rough.max() <= 0.10),
    )
