"""A real flaw's relief out of a recording: registered, levelled, denoised, laid on a lattice."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.interpolate import CloughTocher2DInterpolator, NearestNDInterpolator

from defects.flaw_bank import Relief
from defects.kinds.banked import spread
from defects.surface.surface import Site, SiteError, Surface, tangent_axes
from diagnosis.noise.noise_model import NoiseModel, calibrate
from diagnosis.register.registration import register, smooth_weight
from files.errors import RecipeError
from flawforge.flaw.relief_denoising import Denoised, denoise
from pipeline.parts.part import Part
from sensors.casting.laser import Laser
from sensors.casting.scene import Scene
from sensors.datasheet import Datasheet
from sensors.recording import Recording, repeated_rows

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

RIM_SHARE, RIM_LEAST = 0.25, 6
"""Width of the rim around the region that levels it: share of the region's side, readings."""
FADE = 0.1
"""Share of the region's shorter side over which the relief fades to zero at the region's rim."""
FOUND_SD = 4.0
"""Standard deviations of the denoised heights from which they belong to the flaw: of a thousand
independent places on a sound surface 0.06 are beyond."""
KEPT_SHARE = 0.05
"""Pieces of the flaw with less than this share of the largest one's volume are left out."""
MOST_NODES = 160_000
FADE_NODES = 3
"""Nodes beyond the flaw over which its relief meets the skin."""
MARGIN = FADE_NODES + 3
"""Nodes between the flaw and the lattice's rim."""
SPIKE_SD = 6.0
"""Standard deviations of the noise by which an outlier stands out of all its eight neighbours."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Region:
    """Where the flaw is: profiles and points, or a box of the part's x and y, mm."""

    ranges: tuple[slice, slice] | None = None
    box_mm: tuple[float, float, float, float] | None = None

    def mask(self, points_mm: Floats) -> Bools:
        """Return which readings (n, m) lie in it, their points (n, m, 3) in the part frame."""
        inside = np.zeros(points_mm.shape[:2], np.bool_)
        if self.ranges is not None:
            inside[self.ranges] = True
        if self.box_mm is not None:
            x0, y0, x1, y1 = self.box_mm
            x, y = points_mm[..., 0], points_mm[..., 1]
            inside |= (x >= x0) & (x <= x1) & (y >= y0) & (y <= y1)
        return inside


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Extracted:
    """A flaw and what it was taken from.

    Attributes
    ----------
    relief : Relief
    site : Site
        Where it sits on the part.
    raw_mm : (n, m) float64
        Levelled heights over the skin around the flaw, as read.
    pitch_mm : (float, float)
        Distance of profiles and of points there.
    noise : NoiseModel
        Of heights along the normal.
    """

    relief: Relief
    site: Site
    raw_mm: Floats
    pitch_mm: tuple[float, float]
    noise: NoiseModel
    denoised: Denoised


def extract(
    recording: Recording, part: Part, datasheet: Datasheet, region: Region, name: str
) -> Extracted:
    """Take the flaw in a region out of a recording.

    The recording is registered without the region's readings. Heights are distances of readings
    from the part along its local normal; a plane through the rim around the region is taken off
    (form that the part's mesh lacks). The noise is measured on smooth faces outside the region.

    Raises
    ------
    RecipeError
        Where the recording doesn't meet the part or the region holds no flaw above the noise.
    """
    read = _levelled(recording, part, datasheet, region)
    raw, pitch, noise, inside = read.raw_mm, read.pitch_mm, read.noise, read.inside
    power = noise.sd_mm**2 * np.maximum(noise.spectrum(raw.shape), 1e-6)
    # Once with the whole region's smoothness, to find the flaw; then with the flaw's own.
    sought = denoise(raw, power, pitch, np.ones(raw.shape, np.bool_))
    found = _found(sought.height_mm * _fade(inside), inside, sought.sd_mm, recording.name)
    denoised = denoise(raw, power, pitch, ndimage.binary_dilation(found, iterations=2))
    smoothed = denoised.height_mm * _fade(inside)
    site, nodes, step = _lattice(read.surface, read.feet, smoothed, found, pitch)
    try:
        patch = spread(read.surface, site, nodes, (step, step))
    except SiteError as error:
        raise RecipeError(f"the flaw has no flat map: {error}", where=recording.name) from None
    height, mask = _on_lattice(patch.skin_mm, site, read.feet, smoothed, found, nodes)
    relief = Relief(
        name=name,
        pitch_mm=step,
        height_mm=height,
        mask=mask,
        facts={
            "recording": recording.name,
            "comment": recording.comment,
            "import_options": recording.import_options,
            "part": part.name,
            "sensor": datasheet.name,
            "profiles": [read.window[0].start, read.window[0].stop],
            "points": [read.window[1].start, read.window[1].stop],
            "position_mm": site.position_mm.tolist(),
            "normal": site.normal.tolist(),
            "heading": site.direction().tolist(),
            "registration_mm_rad": read.shift.tolist(),
            "pitch_profiles_mm": pitch[0],
            "pitch_points_mm": pitch[1],
            "noise_sd_mm": noise.sd_mm,
            "noise_correlation_px": list(noise.correlation_length_px()),
            "denoised_sd_mm": denoised.sd_mm,
            "prior_length_mm": denoised.length_mm,
        },
    )
    return Extracted(
        relief=relief, site=site, raw_mm=raw, pitch_mm=pitch, noise=noise,
        denoised=denoised,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Levelled:
    """Heights over the skin in a window around the region, as read.

    Attributes
    ----------
    raw_mm : (n, m) heights, levelled by the region's rim
    inside : (n, m) bool, the region
    feet : (n, m, 3) places on the skin
    shift : of the registration
    """

    surface: Surface
    window: tuple[slice, slice]
    inside: Bools
    raw_mm: Floats
    feet: Floats
    pitch_mm: tuple[float, float]
    noise: NoiseModel
    shift: Floats


def _levelled(
    recording: Recording, part: Part, datasheet: Datasheet, region: Region
) -> _Levelled:
    """Register the recording without the region, and measure its heights and the noise."""
    scene = Scene(part.vertices_mm, part.faces)
    laser = Laser.of_recording(datasheet, recording)
    read = np.isfinite(recording.depth_mm) & ~repeated_rows(recording.depth_mm)[:, None]
    depth = np.where(read, recording.depth_mm, np.nan)
    wanted = region.mask(laser.points_part_mm(depth, recording.poses))
    if not (wanted & read).any():
        raise RecipeError("--region holds no reading", where=recording.name)
    placed = register(scene, recording, laser, datasheet=datasheet, valid=read & ~wanted)
    wanted = region.mask(laser.points_part_mm(depth, placed.poses))
    hits = scene.cast(laser, placed.poses)
    normal = scene.normals[hits.triangle]
    turned = placed.poses[:, None]
    axis = turned[..., :3, 2] + laser.slope_x[None, :, None] * turned[..., :3, 0]
    rough = (depth - hits.depth_mm) * np.einsum("nmk,nmk->nm", normal, axis)
    on_part = laser.points_part_mm(hits.depth_mm, placed.poses)
    pitch = _pitch(on_part)
    smooth = smooth_weight(hits.depth_mm, normal, max(pitch)) == 1.0
    noise = calibrate(
        [rough], [smooth & read & ~wanted], pitch_mm=(pitch[1], pitch[0]), missing_share=0.0,
    )  # fmt: skip
    window = _around(wanted)
    inside = wanted[window]
    points = laser.points_part_mm(depth, placed.poses)[window]
    surface = Surface.of(part.vertices_mm, part.faces)
    feet, heights = _over_the_skin(surface, points, on_part[window])
    heights[_spikes(heights, noise.sd_mm)] = np.nan
    return _Levelled(
        surface=surface, window=window, inside=inside, raw_mm=heights - _level(heights, inside),
        feet=feet, pitch_mm=pitch, noise=noise, shift=placed.shift,
    )  # fmt: skip


def _pitch(points: Floats) -> tuple[float, float]:
    """Return the median distance of profiles and of points on the part, mm."""
    rows, columns = (
        float(np.nanmedian(np.linalg.norm(np.diff(points, axis=axis), axis=2))) for axis in (0, 1)
    )
    return rows, columns


def _around(wanted: Bools) -> tuple[slice, slice]:
    """Return the rows and columns of a region with its rim."""
    spans = []
    for axis in (0, 1):
        there = np.flatnonzero(wanted.any(axis=1 - axis))
        first, end = int(there[0]), int(there[-1]) + 1
        rim = max(RIM_LEAST, round(RIM_SHARE * (end - first)))
        spans.append(slice(max(first - rim, 0), min(end + rim, wanted.shape[axis])))
    return spans[0], spans[1]


def _over_the_skin(surface: Surface, points: Floats, hits: Floats) -> tuple[Floats, Floats]:
    """Return where readings (n, m, 3) stand on the skin, and how far above it they are.

    Where there is none, the foot is where the ray meets the part.
    """
    feet = hits.copy()
    heights = np.full(points.shape[:2], np.nan)
    seen = np.isfinite(points).all(axis=2)
    onto, normals, _ = surface.project(points[seen])
    feet[seen] = onto
    heights[seen] = np.sum((points[seen] - onto) * normals, axis=1)
    return feet, heights


def _spikes(heights: Floats, sd: float) -> Bools:
    """Return readings that stand out of all their neighbours."""
    ring = np.ones((3, 3), np.bool_)
    ring[1, 1] = False
    high = ndimage.maximum_filter(np.nan_to_num(heights, nan=-np.inf), footprint=ring)
    low = ndimage.minimum_filter(np.nan_to_num(heights, nan=np.inf), footprint=ring)
    return np.asarray((heights > high + SPIKE_SD * sd) | (heights < low - SPIKE_SD * sd))


def _level(heights: Floats, inside: Bools) -> Floats:
    """Return the plane through the rim, by least squares with Tukey's biweight."""
    rows, columns = np.indices(heights.shape)
    design = np.stack([np.ones(heights.size), rows.ravel(), columns.ravel()], axis=1)
    rim = (~inside & np.isfinite(heights)).ravel()
    if rim.sum() < 20:
        return np.zeros(heights.shape)
    values, weight = heights.ravel()[rim], rim[rim].astype(np.float64)
    plane = np.linalg.lstsq(design[rim], values, rcond=None)[0]
    for _ in range(10):
        root = np.sqrt(weight)
        plane = np.linalg.lstsq(design[rim] * root[:, None], values * root, rcond=None)[0]
        away = values - design[rim] @ plane
        scale = max(1.4826 * float(np.median(np.abs(away))), 1e-9)
        weight = np.square(1 - np.square(np.clip(away / (4.685 * scale), -1, 1)))
    return np.asarray((design @ plane).reshape(heights.shape))


def _fade(inside: Bools) -> Floats:
    """Return a window: 0 outside the region, 1 well inside, smooth between."""
    away = ndimage.distance_transform_edt(np.pad(inside, 1))[1:-1, 1:-1]
    t = np.clip(away / max(FADE * 2 * float(away.max()), 1.0), 0.0, 1.0)
    return np.asarray(t * t * (3 - 2 * t))


def _found(heights: Floats, inside: Bools, sd: float, name: str) -> Bools:
    """Return which places belong to the flaw."""
    out = inside & (np.abs(heights) > FOUND_SD * sd)
    labels, count = ndimage.label(ndimage.binary_opening(out), np.ones((3, 3)))
    if count == 0:
        largest = float(np.abs(heights).max())
        raise RecipeError(
            "--region holds no flaw above the noise", where=name,
            value=f"{1e3 * largest:.3g} µm at most, denoised",
            allowed=f"above {1e3 * FOUND_SD * sd:.3g} µm",
        )  # fmt: skip
    volume = ndimage.sum_labels(np.abs(heights), labels, np.arange(1, count + 1))
    kept = 1 + np.flatnonzero(volume >= KEPT_SHARE * volume.max())
    return np.asarray(ndimage.binary_fill_holes(np.isin(labels, kept)))


def _lattice(
    surface: Surface, feet: Floats, heights: Floats, found: Bools, pitch: tuple[float, float]
) -> tuple[Site, tuple[int, int], float]:
    """Return where the flaw sits, heading along its longer axis; the lattice's nodes and pitch."""
    there = found & np.isfinite(feet).all(axis=2)
    points, weight = feet[there], np.abs(heights[there])
    middle = np.average(points, axis=0, weights=weight)
    site = _site(surface, middle, np.zeros(3))
    flat = _flat(site, points)
    spread_ = np.cov((flat - np.average(flat, axis=0, weights=weight)).T, aweights=weight)
    longer = np.linalg.eigh(spread_)[1][:, -1]
    first, second = _frame(site)
    heading = longer[0] * first + longer[1] * second
    for _ in range(3):  # the middle of a bent flaw moves with its frame
        site = _site(surface, middle, heading)
        flat = _flat(site, points)
        offset = (flat.min(axis=0) + flat.max(axis=0)) / 2
        first, second = _frame(site)
        middle = site.position_mm + offset[0] * first + offset[1] * second
    reach = np.abs(flat).max(axis=0)
    step = min(pitch)
    step *= max(1.0, float(np.sqrt(4 * np.prod(reach / step + MARGIN) / MOST_NODES)))
    half = np.ceil(reach / step).astype(int) + MARGIN
    return site, (2 * int(half[0]) + 1, 2 * int(half[1]) + 1), float(step)


def _site(surface: Surface, point: Floats, heading: Floats) -> Site:
    onto, normals, triangles = surface.project(point[None])
    first, second = tangent_axes(normals[0])
    return Site(
        position_mm=onto[0],
        normal=normals[0],
        heading_rad=float(np.arctan2(heading @ second, heading @ first)),
        triangle=int(triangles[0]),
    )


def _frame(site: Site) -> tuple[Floats, Floats]:
    return site.direction(), site.direction(np.pi / 2)


def _flat(site: Site, points: Floats) -> Floats:
    """Return coordinates (..., 2) of points (..., 3) in the tangent plane, along and across."""
    return np.stack([(points - site.position_mm) @ axis for axis in _frame(site)], axis=-1)


def _on_lattice(
    nodes_mm: Floats, site: Site, feet: Floats, heights: Floats, found: Bools,
    nodes: tuple[int, int],
) -> tuple[Floats, Bools]:
    """Return heights and mask at the lattice's nodes, by their places in the tangent plane."""
    known = np.isfinite(feet).all(axis=2)
    flat, at = _flat(site, feet[known]), _flat(site, nodes_mm)
    height = CloughTocher2DInterpolator(flat, heights[known], fill_value=0.0)(at).reshape(nodes)
    mask = NearestNDInterpolator(flat, found[known])(at).reshape(nodes).astype(np.bool_)
    for edge in (slice(None, MARGIN - 1), slice(1 - MARGIN, None)):
        mask[edge] = mask[:, edge] = False
    wider = ndimage.binary_dilation(mask, ndimage.generate_binary_structure(2, 2), FADE_NODES)
    t = np.clip(ndimage.distance_transform_edt(wider) / (FADE_NODES + 1), 0.0, 1.0)
    return np.asarray(height * t * t * (3 - 2 * t)), mask
