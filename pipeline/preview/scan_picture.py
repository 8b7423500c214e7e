"""A picture of one scan: depth, labels, a cut through a flaw with and without noise, the cloud."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from files.errors import RecipeError
from files.place import place
from files.whole_file import whole
from pipeline.dataset.shards import read_scan, reason_names
from pipeline.dataset.tables import read_table
from pipeline.preview.annotation import COLOURS, colour_of, spread
from pipeline.preview.chart import LONGEST_PX, Chart
from pipeline.preview.cloud import DEPTH_MAP, draw_cloud
from pipeline.preview.cut import draw_cut

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]
Numbers = NDArray[Any]

DPI = 120
WIDE = 2.2  # a longer picture than this gets a row of its own
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
    figure = scan_figure(folder, scan_id)
    with whole(path) as aside:
        figure.savefig(aside, dpi=DPI)
    return Path(path)


def scan_figure(folder: str | Path, scan_id: str | None = None) -> "Figure":
    """Return the picture of a scan as a figure."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    folder = place(folder)
    manifest, flaws = _tables(folder)
    scan_id = most_visible(manifest, flaws) if scan_id is None else scan_id
    found = manifest[manifest["scan_id"] == scan_id]
    if found.empty:
        names = [str(name) for name in manifest["scan_id"]]
        some = ", ".join(names[:5] + ["..."] * (len(names) > 5))
        raise RecipeError("no such scan", where=folder, value=scan_id, allowed=some)
    row = found.iloc[0]
    shard = folder / str(row["shard"])
    scan = read_scan(shard, int(row["row"]))
    own = flaws[flaws["scan_id"] == scan_id]
    chart = Chart.of(scan)
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
    limits = _depth_image(figure, depth_axes, chart, scan, reason_names(shard))
    _label_image(label_axes, chart, scan, kinds)
    draw_cut(cut_axes, chart, scan, kinds)
    draw_cloud(cloud_axes, scan, kinds, limits)
    return figure


def most_visible(manifest: "pd.DataFrame", flaws: "pd.DataFrame") -> str:
    """Return the id of the scan with the flaw that stands out most: visible pixels x deviation."""
    if len(manifest) == 0:
        raise RecipeError("the dataset holds no scan")
    if len(flaws) == 0 or not (flaws["pixels_visible"] > 0).any():
        return str(manifest["scan_id"].iloc[0])
    standing_out = flaws["pixels_visible"] * flaws["deviation_over_noise"].fillna(1.0).clip(0, 20)
    return str(flaws["scan_id"].iloc[int(np.argmax(standing_out.to_numpy()))])


def _tables(folder: Path) -> tuple["pd.DataFrame", "pd.DataFrame"]:
    paths = [folder / f"{name}.parquet" for name in ("manifest", "flaws")]
    for path in paths:
        if not path.is_file():
            from pipeline.dataset.verify import read_dataset

            read_dataset(folder)  # says it where the dataset isn't finished
            raise RecipeError(f"no dataset here ({path.name} is missing)", where=folder)
    return read_table(paths[0]), read_table(paths[1])


def _facts(row: "pd.Series[Any]", scan: Mapping[str, Any]) -> str:
    profiles, points = scan["depth"].shape
    valid = np.isfinite(scan["depth"]).mean()
    facts = [f"part {row['part']}", f"{profiles} profiles × {points} points"]
    facts += [f"{name} {row[name]}" for name in ("sensor", "surface", "split") if row.get(name)]
    return "   ·   ".join([*facts, f"{valid:.1%} of the points valid"])


def _depth_image(
    figure: "Figure", axes: "Axes", chart: Chart, scan: Mapping[str, Any],
    reasons: Mapping[int, str],
) -> tuple[float, float]:  # fmt: skip
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    depth = chart.image(scan["depth"])
    reason = chart.image(scan["invalid_reason"])
    named = {number: name for number, name in reasons.items() if number > 0}
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
    axes: "Axes", chart: Chart, scan: Mapping[str, Any], kinds: Mapping[int, str]
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


def _number(axes: "Axes", chart: Chart, instance: Numbers, kinds: Mapping[int, str]) -> None:
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


def _relief(chart: Chart, scan: Mapping[str, Any]) -> Floats:
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


def _colour(kinds: Mapping[int, str], number: int) -> str:
    return colour_of(kinds.get(number, "flaw"))
