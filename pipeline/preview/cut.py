"""A cut across a flaw: unflawed, flawed and measured heights over one straight line."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.preview.annotation import DARK, colour_of
from pipeline.preview.chart import Chart

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]
Numbers = NDArray[Any]


def draw_cut(axes: "Axes", chart: Chart, scan: Mapping[str, Any], kinds: Mapping[int, str]) -> None:
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
        profile, window, along = place_of_cut(instance == number, deviation, chart)
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


def place_of_cut(here: Numbers, deviation: Floats, chart: Chart) -> tuple[int, slice, bool]:
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


def _colour(kinds: Mapping[int, str], number: int) -> str:
    return colour_of(kinds.get(number, "flaw"))
