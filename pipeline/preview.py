"""A picture of one scan: depth, labels, a cut through a flaw with and without noise, the cloud."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import Camera, light, splat
from pipeline.preview_setup import COLOURS, DARK, draw_setup, scale_bar, spread, triad
from pipeline.shards import read_scan
from sensors.typed_yaml import RecipeError

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["draw_scan", "draw_setup", "most_visible"]

Floats = NDArray[np.float64]
Numbers = NDArray[Any]

DPI = 120
WIDE = 2.2  # a longer picture than this gets a row of its own
LONGEST_PX = 1500
DEPTH_MAP = "viridis_r"
REASONS = {  # how a point without a return is drawn
    "no_hit": "#FFFFFF",
    "out_of_range": "#E4E4E4",
    "hidden_from_camera": "#9A9A9A",
    "dropout": "#F2B8B5",
    "hidden_by_flaw": "#E4572E",
}


def draw_scan(folder: str | Path, path: str | Path, *, scan_id: str | None = None) -> Path:
    """Draw one scan of a dataset.

    Parameters
    ----------
    folder : path
        The dataset.
    path : path
        PNG to write.
    scan_id : str, optional
        Which scan; the one with the most visible flaw where it isn't said.

    Returns
    -------
    Path
        The picture.

    Raises
    ------
    RecipeError
        Where there is no dataset, or no such scan in it.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    manifest, flaws = _tables(Path(folder))
    scan_id = most_visible(manifest, flaws) if scan_id is None else scan_id
    found = manifest[manifest["scan_id"] == scan_id]
    if found.empty:
        names = [str(name) for name in manifest["scan_id"]]
        some = ", ".join(names[:5] + ["..."] * (len(names) > 5))
        raise RecipeError("no such scan", where=folder, value=scan_id, allowed=some)
    row = found.iloc[0]
    scan = read_scan(Path(folder) / str(row["shard"]), int(row["row"]))
    own = flaws[flaws["scan_id"] == scan_id]
    chart = _Chart.of(scan)
    stacked = chart.width_mm > WIDE * chart.height_mm
    figure = Figure(figsize=(14.0, 11.6 if stacked else 10.4), dpi=DPI, facecolor="white")
    FigureCanvasAgg(figure)
    high = figure.get_figheight()
    figure.text(0.035, 1 - 0.28 / high, str(scan_id), fontsize=15, weight="bold", va="top")
    figure.text(0.035, 1 - 0.62 / high, _facts(row, scan), fontsize=9.5, va="top", color="#444")
    if stacked:
        boxes = ((0.055, 0.735, 0.86, 0.165), (0.055, 0.475, 0.86, 0.165))
        below = ((0.065, 0.065, 0.40, 0.30), (0.53, 0.02, 0.45, 0.345))
    else:
        boxes = ((0.055, 0.545, 0.385, 0.345), (0.58, 0.545, 0.385, 0.345))
        below = ((0.065, 0.065, 0.40, 0.33), (0.53, 0.02, 0.45, 0.385))
    depth_axes, label_axes = (figure.add_axes(box) for box in boxes)
    cut_axes, cloud_axes = (figure.add_axes(box) for box in below)
    kinds = {int(flaw["instance"]): str(flaw["kind"]) for _, flaw in own.iterrows()}
    limits = _depth_image(figure, depth_axes, chart, scan)
    _label_image(label_axes, chart, scan, kinds)
    _cut(cut_axes, chart, scan, kinds)
    _cloud(cloud_axes, scan, kinds, limits)
    figure.savefig(path, dpi=DPI)
    return Path(path)


def most_visible(manifest: "pd.DataFrame", flaws: "pd.DataFrame") -> str:
    """Return the id of the scan with the flaw that stands out most: visible pixels x deviation."""
    if len(manifest) == 0:
        raise RecipeError("the dataset holds no scan")
    if len(flaws) == 0 or not (flaws["pixels_visible"] > 0).any():
        return str(manifest["scan_id"].iloc[0])
    standing_out = flaws["pixels_visible"] * flaws["deviation_over_noise"].fillna(1.0).clip(0, 20)
    return str(flaws["scan_id"].iloc[int(np.argmax(standing_out.to_numpy()))])


def _tables(folder: Path) -> tuple["pd.DataFrame", "pd.DataFrame"]:
    import pandas as pd

    paths = [folder / f"{name}.parquet" for name in ("manifest", "flaws")]
    for path in paths:
        if not path.is_file():
            raise RecipeError(f"no dataset here ({path.name} is missing)", where=folder)
    return pd.read_parquet(paths[0]), pd.read_parquet(paths[1])


def _facts(row: "pd.Series[Any]", scan: Mapping[str, Any]) -> str:
    profiles, points = scan["depth"].shape
    valid = np.isfinite(scan["depth"]).mean()
    facts = [f"part {row['part']}", f"{profiles} profiles × {points} points"]
    facts += [f"{name} {row[name]}" for name in ("sensor", "surface", "split") if row.get(name)]
    return "   ·   ".join([*facts, f"{valid:.1%} of the points valid"])


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Chart:
    """A scan laid out in mm: x along the laser line, travel across; the longer one horizontal.

    `rows` and `columns` say which profile and point each display pixel shows; both ascend in mm.
    """

    x_mm: Floats
    travel_mm: Floats
    rows: Numbers
    columns: Numbers
    order: Numbers
    upright: bool

    @classmethod
    def of(cls, scan: Mapping[str, Any]) -> "_Chart":
        depth = scan["depth"]
        middle = np.nanmedian(depth) if np.isfinite(depth).any() else 1.0
        x = scan["ray_x_mm"] + scan["ray_slope"] * middle
        steps = np.linalg.norm(np.diff(scan["pose"][:, :3, 3], axis=0), axis=1)
        travel = np.concatenate([[0.0], np.cumsum(steps)])
        order = np.argsort(x, kind="stable")
        x = x[order]
        span = max(np.ptp(x), np.ptp(travel), 1e-9)
        return cls(
            x_mm=x,
            travel_mm=travel,
            rows=_nearest(travel, span),
            columns=_nearest(x, span),
            order=order,
            upright=bool(np.ptp(x) >= np.ptp(travel)),
        )

    def image(self, values: Numbers) -> Numbers:
        """Pick what each pixel shows, (height, width)."""
        picked = values[:, self.order][np.ix_(self.rows, self.columns)]
        return np.asarray(picked if self.upright else picked.T)

    def largest(self, values: Numbers) -> Numbers:
        """Like `image`, but the largest value in each pixel, so that no thin crack is lost."""
        pooled: Numbers = np.maximum.reduceat(values[:, self.order], self.rows, axis=0)
        pooled = np.maximum.reduceat(pooled, self.columns, axis=1)
        return np.asarray(pooled if self.upright else pooled.T)

    @property
    def extent_mm(self) -> tuple[float, float, float, float]:
        """Edges for imshow with the origin at the lower left."""
        x = (float(self.x_mm[0]), float(self.x_mm[-1]))
        travel = (float(self.travel_mm[0]), float(self.travel_mm[-1]))
        return (*x, *travel) if self.upright else (*travel, *x)

    @property
    def backdrop(self) -> dict[str, Any]:
        """What imshow has to know."""
        return {"extent": self.extent_mm, "origin": "lower", "interpolation": "nearest"}

    @property
    def width_mm(self) -> float:
        """Length of the longer side, mm."""
        return self.extent_mm[1] - self.extent_mm[0]

    @property
    def height_mm(self) -> float:
        """Length of the shorter side, mm."""
        return self.extent_mm[3] - self.extent_mm[2]

    def name_axes(self, axes: "Axes") -> None:
        """Label the axes of an image."""
        along, across = "x along the laser line, mm", "travel, mm"
        axes.set_xlabel(along if self.upright else across)
        axes.set_ylabel(across if self.upright else "x, mm")
        axes.tick_params(labelsize=9)
        axes.set_aspect("equal")


def _nearest(place_mm: Floats, span_mm: float) -> Numbers:
    """Return the sample that each of evenly spaced pixels shows, never descending."""
    count = max(2, min(LONGEST_PX, round(LONGEST_PX * float(np.ptp(place_mm)) / span_mm)))
    even = np.linspace(place_mm[0], place_mm[-1], count)
    between = (place_mm[1:] + place_mm[:-1]) / 2
    return np.asarray(np.searchsorted(between, even))


def _depth_image(
    figure: "Figure", axes: "Axes", chart: _Chart, scan: Mapping[str, Any]
) -> tuple[float, float]:
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    from pipeline.scan import REASON_NAMES

    depth = chart.image(scan["depth"])
    reason = chart.image(scan["invalid_reason"])
    named = {number: name for number, name in REASON_NAMES.items() if number > 0}
    shades = ListedColormap(["#FFFFFF", *(REASONS.get(n, "#CCCCCC") for n in named.values())])
    backdrop = chart.backdrop
    axes.imshow(reason, cmap=shades, vmin=-0.5, vmax=len(named) + 0.5, **backdrop)
    low, high = _limits(scan["depth"])
    picture = axes.imshow(depth, cmap=DEPTH_MAP, vmin=low, vmax=high, **backdrop)
    chart.name_axes(axes)
    axes.set_title("Reading: depth", loc="left", fontsize=11.5)
    axes.apply_aspect()
    box = axes.get_position()
    bar_axes = figure.add_axes((box.x1 + 0.009, box.y0, 0.011, box.height))
    bar = figure.colorbar(picture, cax=bar_axes)
    bar.set_label("depth, mm", fontsize=9.5)
    bar.ax.tick_params(labelsize=9)
    bar.ax.invert_yaxis()
    handles = []
    for number, name in named.items():
        share = float((scan["invalid_reason"] == number).mean())
        if share > 0:
            text = f"{name.replace('_', ' ')} {share:.1%}"
            handles.append(Patch(facecolor=REASONS.get(name, "#CCC"), edgecolor="#888", label=text))
    if handles:
        _legend_below(axes, handles)
    return low, high


def _legend_below(axes: "Axes", handles: list[Any]) -> None:
    axes.legend(
        handles=handles, loc="upper center", bbox_to_anchor=(0.5, 0.0), ncols=len(handles),
        frameon=False, fontsize=9, handlelength=1.1, handleheight=1.0, columnspacing=1.1,
        borderaxespad=3.6,
    )  # fmt: skip


def _limits(depth_mm: Floats) -> tuple[float, float]:
    if not np.isfinite(depth_mm).any():
        return 0.0, 1.0
    low, high = (float(v) for v in np.nanpercentile(depth_mm, (0.2, 99.8)))
    return low, max(high, low + 1e-3)


def _label_image(
    axes: "Axes", chart: _Chart, scan: Mapping[str, Any], kinds: Mapping[int, str]
) -> None:
    from matplotlib.colors import to_rgb
    from matplotlib.patches import Patch

    relief = _relief(chart, scan)
    picture = np.repeat(relief[..., None], 3, axis=2)
    instance = chart.largest(scan["instance"])
    seen = chart.largest(np.where(scan["mask_visible"] > 0, scan["instance"], 0))
    for number in np.unique(instance[instance > 0]):
        colour = np.array(to_rgb(_colour(kinds, int(number))))
        here, strong = instance == number, seen == number
        for where, tint in ((here & ~strong, 0.38), (strong, 0.78)):
            picture[where] = (1 - tint) * picture[where] + tint * colour
    backdrop = chart.backdrop
    axes.imshow(np.clip(picture, 0, 1), **backdrop)
    _number(axes, chart, instance, kinds)
    chart.name_axes(axes)
    axes.set_title("Labels over the noise-free relief", loc="left", fontsize=11.5)
    present = {kinds.get(int(number), "flaw") for number in np.unique(instance[instance > 0])}
    handles = [Patch(facecolor=COLOURS[kind], label=kind) for kind in COLOURS if kind in present]
    if present:
        handles.append(Patch(facecolor="#999", alpha=0.45, label="pale: below the noise"))
        _legend_below(axes, handles)


def _number(axes: "Axes", chart: _Chart, instance: Numbers, kinds: Mapping[int, str]) -> None:
    """Write each flaw's number beside it."""
    numbers = [int(number) for number in np.unique(instance) if number > 0]
    if not numbers:
        return
    left, right, bottom, top = chart.extent_mm
    height, width = instance.shape
    centres = []
    for number in numbers:
        rows, columns = np.nonzero(instance == number)
        centres.append([columns.mean() / width, rows.mean() / height])
    at = np.array(centres) * [right - left, top - bottom] + [left, bottom]
    box = axes.get_window_extent()
    mm_per_px = max((right - left) / box.width, (top - bottom) / box.height)
    labels = spread(at + 24 * mm_per_px, at, 26 * mm_per_px)
    inset = 12 * mm_per_px
    labels = np.clip(labels, [left + inset, bottom + inset], [right - inset, top - inset])
    for number, start, end in zip(numbers, at, labels, strict=True):
        colour = _colour(kinds, number)
        axes.plot(*np.stack([start, end]).T, color=colour, lw=0.9)
        axes.text(
            float(end[0]), float(end[1]), str(number), fontsize=8, color="white", weight="bold",
            ha="center", va="center",
            bbox={"boxstyle": "circle,pad=0.2", "fc": colour, "ec": "white", "lw": 0.7},
        )  # fmt: skip


def _relief(chart: _Chart, scan: Mapping[str, Any]) -> Floats:
    """Picture of the noise-free surface under a low light, slopes exaggerated (brightness)."""
    # what is finer than a display pixel needs no shading of its own
    thin_y, thin_x = (max(1, count // LONGEST_PX) for count in scan["depth"].shape)
    height = -np.asarray(scan["depth_ideal"][::thin_y, chart.order[::thin_x]], dtype=float)
    step_x = np.gradient(chart.x_mm[::thin_x])
    step_y = np.gradient(chart.travel_mm[::thin_y])
    with np.errstate(invalid="ignore", divide="ignore"):
        slope_x = np.gradient(height, axis=1) / step_x
        slope_y = np.gradient(height, axis=0) / step_y[:, None]
    known = np.isfinite(slope_x) & np.isfinite(slope_y)
    if not known.any():
        return chart.image(np.full(scan["depth"].shape, 1.0))
    slope_x = slope_x - np.median(slope_x[known])
    slope_y = slope_y - np.median(slope_y[known])
    typical = np.percentile(np.hypot(slope_x, slope_y)[known], 97)
    gain = np.clip(0.35 / max(float(typical), 1e-9), 1.0, 12.0)
    normal = np.stack([-gain * slope_x, -gain * slope_y, np.ones_like(height)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    towards = np.array([-0.55, 0.55, 0.63])
    shade = 0.30 + 0.85 * np.clip(normal @ (towards / np.linalg.norm(towards)), 0.0, 1.0)
    shade = np.where(known, np.clip(shade, 0.0, 0.97), 1.0)
    picked = shade[np.ix_(chart.rows // thin_y, chart.columns // thin_x)]
    return np.asarray(picked if chart.upright else picked.T)


def _cut(axes: "Axes", chart: _Chart, scan: Mapping[str, Any], kinds: Mapping[int, str]) -> None:
    """Plot a cut across the most visible flaw, heights over the unflawed surface's line."""
    instance = scan["instance"][:, chart.order]
    ideal, clean, reading = (
        scan[name][:, chart.order].astype(float) for name in ("depth_ideal", "depth_clean", "depth")
    )
    deviation = np.abs(np.nan_to_num(ideal - clean))
    number = _main_instance(scan["mask_visible"][:, chart.order], instance, deviation)
    if number is None:
        profile, along = len(ideal) // 2, True
        window = slice(0, ideal.shape[1])
    else:
        profile, window, along = _place_of_cut(instance == number, deviation, chart)
    take: Any = (profile, window) if along else (window, profile)
    place = (chart.x_mm if along else chart.travel_mm)[window]
    base = _line_through(place, clean[take])
    heights = {name: base - values[take] for name, values in
               (("clean", clean), ("ideal", ideal), ("reading", reading))}  # fmt: skip
    span = np.nanmax([np.nanmax(np.abs(h), initial=0.0) for h in heights.values()], initial=0.0)
    unit, scale = ("µm", 1000.0) if span < 1.0 else ("mm", 1.0)
    inside = instance[take] > 0
    for first, last in _runs(inside):
        half = np.median(np.diff(place)) / 2 if len(place) > 1 else 0.0
        colour = _colour(kinds, int(instance[take][first]))
        axes.axvspan(place[first] - half, place[last] + half, color=colour, alpha=0.13, lw=0)
    style: dict[str, Any] = {"ms": 4.0, "mew": 0.4, "mec": "white", "zorder": 4}
    axes.plot(place, scale * heights["reading"], "o", color="#5B6B7F", label="reading", **style)
    axes.plot(place, scale * heights["clean"], "--", color=DARK, lw=1.3, label="unflawed, no noise")
    named = "flaw" if number is None else kinds.get(number, "flaw")
    colour = DARK if number is None else _colour(kinds, number)
    axes.plot(place, scale * heights["ideal"], color=colour, lw=2.0, label=f"{named}, no noise")
    where = f"profile {profile}" if along else f"point {chart.order[profile]}"
    which = "the middle" if number is None else f"flaw {number} ({named})"
    axes.set_title(f"Cut through {which}, {where}", loc="left", fontsize=11.5)
    axes.set_xlabel("x along the laser line, mm" if along else "travel, mm")
    axes.set_ylabel(f"height over the unflawed line, {unit}")
    axes.tick_params(labelsize=9)
    axes.grid(color="#E6E8EB", lw=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.margins(x=0.01)
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.2 * (high - low))
    axes.legend(loc="upper right", ncols=3, frameon=False, fontsize=9, columnspacing=1.2)


def _main_instance(visible: Numbers, instance: Numbers, deviation: Floats) -> int | None:
    """Find the number of the flaw that stands out most, None where there is none."""
    if not (instance > 0).any():
        return None
    counted = np.where(visible > 0, instance, 0) if (visible > 0).any() else instance
    weight = np.bincount(counted.ravel(), weights=deviation.ravel() + 1e-9)
    weight[0] = 0.0
    return int(weight.argmax())


def _place_of_cut(here: Numbers, deviation: Floats, chart: _Chart) -> tuple[int, slice, bool]:
    """Return the line to cut along, the window on it, and whether it is a profile (or travel)."""
    rows, columns = np.nonzero(here)
    length_x = float(np.ptp(chart.x_mm[columns]))
    length_y = float(np.ptp(chart.travel_mm[rows]))
    along = length_x <= 2.5 * length_y
    strength = (deviation * here).sum(axis=1 if along else 0)
    middle = int(np.median(rows if along else columns))
    line = int(strength.argmax()) if strength.max() > 0 else middle
    on = np.flatnonzero(here[line] if along else here[:, line])
    count = here.shape[1] if along else here.shape[0]
    room = max(12, round(0.8 * (on[-1] - on[0] + 1)))
    return line, slice(max(0, int(on[0]) - room), min(count, int(on[-1]) + room + 1)), along


def _line_through(place: Floats, depth_mm: Floats) -> Floats:
    """Return the best straight line through the depths, at every place."""
    known = np.isfinite(depth_mm)
    if known.sum() < 2:
        return np.full(len(place), np.nanmean(depth_mm) if known.any() else 0.0)
    return np.asarray(np.polyval(np.polyfit(place[known], depth_mm[known], 1), place))


def _runs(flags: Numbers) -> list[tuple[int, int]]:
    """First and last index of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    return [(int(first), int(last) - 1) for first, last in edges.reshape(-1, 2)]


def _cloud(
    axes: "Axes", scan: Mapping[str, Any], kinds: Mapping[int, str], limits: tuple[float, float]
) -> None:
    """Draw the readings as shaded points, seen from the sensor's side at an angle."""
    from matplotlib import colormaps
    from matplotlib.colors import to_rgb

    step = max(1, round(np.sqrt(scan["depth"].size / 1.5e6)))
    thin = np.s_[::step, ::step]
    depth, instance = scan["depth"][thin], scan["instance"][thin]
    rays = scan["ray_x_mm"][::step], scan["ray_slope"][::step]
    poses = scan["pose"][::step]
    points = _points_part(depth, rays, poses)
    valid = np.isfinite(depth)
    axes.set_title("Point cloud, part frame", loc="left", fontsize=11.5)
    axes.set_axis_off()
    if valid.sum() < 3:
        axes.text(0.5, 0.5, "no valid points", ha="center", transform=axes.transAxes)
        return
    x, y, z = poses[len(poses) // 2, :3, :3].T
    look = z * np.sin(np.radians(36)) + np.cos(np.radians(36)) * (0.80 * y - 0.60 * x)
    box = axes.get_window_extent()
    pixels = (round(box.width * 1.2), round(box.height * 1.2))
    camera = Camera.around(points[valid], look=look, up=-z, pixels=pixels, foot=0.09)
    colours = colormaps[DEPTH_MAP]((depth - limits[0]) / (limits[1] - limits[0]))[..., :3]
    for number in np.unique(instance[instance > 0]):
        colours[instance == number] = to_rgb(_colour(kinds, int(number)))
    normal = _normals(_points_part(scan["depth_ideal"][thin].astype(float), rays, poses), -z)
    seen = normal[valid] @ camera.frame.T
    brightness = 0.25 + 0.85 * light(seen)
    cloud = points[valid]
    footprint = np.ptp(camera.window_mm[:2]) / pixels[0]
    gaps = np.linalg.norm(np.diff(points, axis=1), axis=2), np.linalg.norm(
        np.diff(points, axis=0), axis=2
    )
    spacing = max(float(np.nanmedian(gap)) for gap in gaps if np.isfinite(gap).any())
    radius = int(np.clip(np.ceil(0.5 * spacing / footprint) + 1, 2, 7))
    picture = splat(
        cloud, np.clip(colours[valid] * brightness[:, None], 0, 1), camera, radius_px=radius
    )
    axes.imshow(picture, extent=camera.extent_mm)
    scale_bar(axes, camera)
    triad(axes, camera)


def _points_part(depth_mm: Floats, rays: tuple[Floats, Floats], poses: Floats) -> Floats:
    x = rays[0] + depth_mm * rays[1]
    sensor = np.stack([x, np.zeros_like(depth_mm), depth_mm], axis=-1)
    return np.asarray(sensor @ poses[:, :3, :3].transpose(0, 2, 1) + poses[:, None, :3, 3])


def _normals(points_mm: Floats, otherwise: Floats) -> Floats:
    """Find the normals of a grid of points (n, m, 3), turned to the side of `otherwise`."""
    if min(points_mm.shape[:2]) < 2:
        return np.broadcast_to(otherwise, points_mm.shape)
    normal = np.cross(np.gradient(points_mm, axis=1), np.gradient(points_mm, axis=0))
    length = np.linalg.norm(normal, axis=2, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        normal = normal / length
    normal = np.where((normal @ otherwise)[..., None] < 0, -normal, normal)
    return np.where(np.isfinite(normal), normal, otherwise)


def _colour(kinds: Mapping[int, str], number: int) -> str:
    return COLOURS.get(kinds.get(number, "flaw"), COLOURS["flaw"])
