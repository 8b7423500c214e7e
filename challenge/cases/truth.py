"""What a case's effect does, seen with other speckle: for the judge."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, label, uniform_filter
from scipy.stats import ks_2samp

from challenge.cases.case import Secret, Staged, scan
from challenge.cases.seeds import child, number
from challenge.cases.stated import Rays, stated
from challenge.cases.switches import World
from challenge.instrument.instrument import Casts, Path
from challenge.instrument.rays import plant
from challenge.instrument.stripes import first_hits

DRAWS = 4
"""Specimens that a case's truth is the mean of."""
LEAST_SHOWN = 1e-2
"""Share of what an offset changes below which readings can't tell a shift.

Slopes that depart from a plane's by some 0.01 mm a point. With flatter ones the few draws' speckle
put a shift of up to 1.4 points into a terrace's truth, a frame about each of its edges.
"""

KS, ROUGHNESS = 0.05, 0.10
"""Distance from the nominal distribution, and relative error of a roughness figure, up to which
the usual checks see nothing: `concealed` of the protocol."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Geometry:
    """What rays alone give: depth, angle to the surface normal, visible, smooth (off edges)."""

    depth_mm: NDArray[np.float64]
    angle_deg: NDArray[np.float64]
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
    fan = camera.angles_rad()
    to_laser = -normal[..., 0] * np.sin(fan) - normal[..., 2] * np.cos(fan)
    angle = np.degrees(np.arccos(np.clip(to_laser, -1.0, 1.0)))
    return Geometry(depth_mm=depth, angle_deg=angle, visible=visible, smooth=~edge)


def levelled(
    rest_mm: NDArray[np.float64], use: NDArray[np.bool_], depth_mm: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Take away what a registration absorbs: offset, tilts and shifts along and across.

    A shift that flats hardly show isn't taken: edges would tell a registration that there is none.

    Parameters
    ----------
    rest_mm : (n, m)
    use : (n, m) bool
        Points that the five numbers are fitted to, without outliers.
    depth_mm : (n, m)
        The part's depth; its slopes turn a shift into a change of depth.

    Returns
    -------
    (n, m)
    """
    rows, columns = np.indices(rest_mm.shape)
    slopes = np.gradient(depth_mm)
    steep = ~(np.abs(slopes[0]) + np.abs(slopes[1]) < 0.3)
    use = use & np.isfinite(rest_mm)
    if use.sum() < 50:
        return rest_mm
    design = np.stack(
        [np.ones(rest_mm.shape), rows / rest_mm.shape[0], columns / rest_mm.shape[1]]
        + [np.where(steep, 0.0, slope) for slope in slopes],
        -1,
    )
    weight = np.ones(int(use.sum()))
    for _ in range(4):
        found = np.linalg.lstsq(
            design[use] * weight[:, None], rest_mm[use] * weight, rcond=LEAST_SHOWN
        )[0]
        left = rest_mm[use] - design[use] @ found
        scale = 1.4826 * np.median(np.abs(left)) + 1e-12
        weight = 1 / np.sqrt(1 + (left / (2.5 * scale)) ** 2)
    return np.asarray(rest_mm - design @ found)


@dataclass(frozen=True, kw_only=True, slots=True)
class Facts:
    """An effect on and off, over independent speckle, in the held-out recording.

    Attributes
    ----------
    on_mm, off_mm : (n, m)
        Mean readings, NaN where most draws have none.
    region : (n, m) bool
        Where the effect matters: patches of 25 points and more.
    fair : (n, m) bool
        Where the maker's file describes the instrument without the effect to two σ, so that gains
        are compared: not where its edges are on the wrong level whatever one knows of the effect.
    noise_um, oracle_gain
        σ without the effect; logarithm of the RMS without the effect's model over that with it.
    oracle_z
        Standard deviations by which the held-out recording alone prefers the oracle's mean with
        the effect to that without, speckle taken as independent beyond 3 x 2 points.
    ks, roughness
        Kolmogorov-Smirnov distance to the nominal simulation with fitted noise; largest relative
        difference of a roughness figure.
    concealed
        True where the usual checks (roughness within 10 %, KS <= 0.05) see nothing.
    """

    on_mm: NDArray[np.float32]
    off_mm: NDArray[np.float32]
    region: NDArray[np.bool_]
    fair: NDArray[np.bool_]
    noise_um: float
    oracle_gain: float
    oracle_z: float
    ks: float
    roughness: float
    concealed: bool

    def figures(self) -> dict[str, float | bool]:
        """Return the numbers without the maps, for the key."""
        names = ("noise_um", "oracle_gain", "oracle_z", "ks", "roughness", "concealed")
        return {name: getattr(self, name) for name in names}


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


@dataclass(frozen=True, kw_only=True, slots=True)
class Draws:
    """The held-out pose scanned with several specimens, (draws, n, m) mm, on and off.

    Attributes
    ----------
    said_mm : (n, m) what the maker's file says without the effect
    smooth : (n, m) away from every edge
    """

    with_it: NDArray[np.float64]
    without: NDArray[np.float64]
    said_mm: NDArray[np.float64]
    smooth: NDArray[np.bool_]

    def level(self, rest_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Take away what a registration absorbs."""
        return levelled(rest_mm, self.smooth, self.said_mm)

    @property
    def noise_mm(self) -> float:
        """Standard deviation of a reading without the effect."""
        rest = self.level(self.without[0] - self.said_mm)
        return float(1.4826 * np.nanmedian(np.abs(rest[self.smooth])))

    def region(self) -> NDArray[np.bool_]:
        """Where the effect moves readings by 0.3 σ, or loses or gains a fifth of them."""
        change = self.level(_mean(self.with_it) - _mean(self.without))
        blocks = uniform_filter(np.nan_to_num(change), 5)
        seen = (np.isfinite(shots).mean(0) for shots in (self.with_it, self.without))
        lost = uniform_filter(np.abs(np.subtract(*seen)), 5)
        return _patches((np.abs(blocks) > 0.3 * self.noise_mm) | (lost > 0.2))


def redraw(staged: Staged, secret: Secret, specimens: range) -> Draws:
    """Scan the held-out pose again with other specimens, with and without the effect."""
    last = secret.recordings - 1
    off = followed(staged.off, last, staged.on.device.sheet.exposure_s)
    delivered = staged.make.delivered

    def shots(world: World) -> NDArray[np.float64]:
        casts: Casts = {}
        return np.stack(
            [
                delivered(*scan(
                    world, world.scans, last,
                    specimen=number(secret.seed, "facts", str(d)),
                    # the same stage phases for every draw and as in the recording
                    rng=child(secret.seed, "noise", "abc"[last]),
                    casts=casts,
                ))[0]
                for d in specimens
            ]
        ).astype(np.float64)  # fmt: skip

    path, misplaced = off.scans.paths[last], off.scans.misplaced[last]
    rays = Rays(off.solid, path, misplaced, off.device.camera, off.device.z_range_mm)
    said = stated(rays, staged.effects).depth_mm.astype(np.float32)
    flat = np.where(geometry(off, path, misplaced).smooth, said, np.float32("nan"))
    return Draws(
        with_it=shots(staged.on),
        without=shots(off),
        said_mm=delivered(said, said)[0].astype(np.float64),
        smooth=np.isfinite(delivered(flat, flat)[0]),
    )


def facts(staged: Staged, secret: Secret, *, draws: int = DRAWS) -> Facts:
    """Tell what an effect does in the held-out pose, and how well it can be seen."""
    last, on = secret.recordings - 1, staged.on
    # the sealed recording's own specimen
    real = staged.make.delivered(*scan(
        on, on.scans, last, specimen=number(secret.seed, "specimen"),
        rng=child(secret.seed, "noise", "abc"[last]),
    ))[0]  # fmt: skip
    return facts_of(redraw(staged, secret, range(draws)), real.astype(np.float64))


def facts_of(drawn: Draws, real: NDArray[np.float64]) -> Facts:
    """Hold a sealed recording (n, m) against the means of other specimens, on and off."""
    with_it, without, said = drawn.with_it, drawn.without, drawn.said_mm
    fill_on, fill_off = _mean(with_it), _mean(without)
    noise, region, flat = drawn.noise_mm, drawn.region(), drawn.level
    with np.errstate(invalid="ignore"):
        fair = np.abs(uniform_filter(np.nan_to_num(flat(fill_off - said)), 3)) < (
            2 * noise
        )
    both = np.isfinite(real) & np.isfinite(fill_on) & np.isfinite(fill_off) & fair
    left_off = levelled(real - fill_off, both, said)[both]
    left_on = (real - fill_on)[both]
    cut = 10 * noise
    ms_off = np.mean(np.clip(left_off, -cut, cut) ** 2) - _noise_of_mean(without, both, cut)
    ms_on = np.mean(np.clip(left_on, -cut, cut) ** 2) - _noise_of_mean(with_it, both, cut)
    nats = 0.5 * both.sum() / 6 * np.log(max(ms_off / ms_on, 1.0))
    one, two = flat(real - said), flat(without[1] - said)
    one, two = np.where(drawn.smooth, one, np.nan), np.where(drawn.smooth, two, np.nan)
    scale = np.nanstd(one) / np.nanstd(two)  # the noise is fitted
    ks = float(ks_2samp(one[np.isfinite(one)], scale * two[np.isfinite(two)]).statistic)
    rough = np.abs(_roughness(one) / (scale * _roughness(two) + 1e-12) - 1)
    rough[-1] = abs(_roughness(one)[-1] / _roughness(two)[-1] - 1)
    return Facts(
        on_mm=fill_on.astype(np.float32),
        off_mm=fill_off.astype(np.float32),
        region=region,
        fair=fair,
        noise_um=1e3 * noise,
        oracle_gain=float(0.5 * np.log(ms_off / ms_on)),
        oracle_z=float(np.sqrt(2 * nats)),
        ks=ks,
        roughness=float(rough.max()),
        concealed=bool(ks <= KS and rough.max() <= ROUGHNESS),
    )


def followed(world: World, index: int, exposure_s: float) -> World:
    """Place the part as the middle of such exposures sees it.

    Profiles are stamped when their exposure begins. A longer exposure lies further on along the
    travel, the same way for every profile: a shift of the part, which a registration takes up
    whole, edges too. The remainder is the blur.
    """
    path = world.scans.paths[index]
    later = 0.5 * (exposure_s - world.device.sheet.exposure_s)
    if later == 0:
        return world
    step = np.eye(4)
    step[1, 3] = path.direction * path.pitch_mm * path.rate_hz * later
    misplaced = list(world.scans.misplaced)
    misplaced[index] = misplaced[index] @ path.start @ step @ np.linalg.inv(path.start)
    return replace(world, scans=replace(world.scans, misplaced=tuple(misplaced)))


def _patches(found: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Leave out patches of less than 25 points: with a few draws they are speckle."""
    number_of, _ = label(found)
    size = np.bincount(number_of.ravel())
    size[0] = 0
    return np.asarray(size[number_of] >= 25)
