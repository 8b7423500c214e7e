"""What the passes of a plan see of a part, and what none of them does."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from files.whole_file import whole
from pipeline.passes.pareto import front
from pipeline.passes.set_cover import Plan
from pipeline.passes.straight_passes import Samples

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_plan(plan: Plan, plans: Sequence[Plan], samples: Samples, title: str, out: Path) -> None:
    """Draw the samples from two sides, unseen ones red, and the trade of the plans."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(14.0, 4.8), layout="constrained")
    points = samples.points_mm
    best = np.max([one.cosine for one in plan.passes], axis=0)
    for k, (elevation, azimuth) in enumerate(((35, -60), (-35, 120))):
        axes = figure.add_subplot(1, 3, k + 1, projection="3d")
        axes.view_init(elev=elevation, azim=azimuth)
        shown = axes.scatter(
            *points[plan.seen].T, c=np.degrees(np.arccos(np.clip(best[plan.seen], 0, 1))),
            s=3, cmap="viridis_r", vmin=0, vmax=75, linewidths=0,
        )  # fmt: skip
        axes.scatter(*points[~plan.seen].T, c="red", s=5, linewidths=0)
        axes.set_box_aspect(np.maximum(np.ptp(points, axis=0), 0.15 * np.ptp(points)))
        axes.set_title(("from above", "from below")[k], fontsize=10)
        axes.tick_params(labelsize=7)
    figure.colorbar(shown, ax=figure.axes, label="incidence, °; red: not seen", shrink=0.7)
    _draw_trade(figure.add_subplot(1, 3, 3), plans, plan)
    figure.suptitle(title, fontsize=11, parse_math=False)
    with whole(out) as aside:
        figure.savefig(aside, dpi=100, metadata={"Software": None})


def _draw_trade(axes: "Axes", plans: Sequence[Plan], chosen: Plan) -> None:
    ends = np.array([(one.length_mm[-1], 100 * one.coverage[-1]) for one in plans])
    optimal = front(plans)
    best = ends[optimal][np.argsort(ends[optimal, 0])]
    axes.scatter(ends[~optimal, 0], ends[~optimal, 1], s=12, color="0.7", label="other plans")
    axes.step(best[:, 0], best[:, 1], where="post", marker="o", ms=5, label="Pareto front")
    axes.plot(
        chosen.length_mm[-1], 100 * chosen.coverage[-1], "o", ms=12, mfc="none", mec="red",
        ls="none", label="written",
    )  # fmt: skip
    axes.axhline(100 * chosen.reachable, color="0.6", ls="--", lw=1, label="all passes tried")
    axes.set_xlabel("length of the passes, mm")
    axes.set_ylabel("surface seen, %")
    axes.set_ylim(0, 103)
    axes.set_xlim(left=0)
    axes.legend(fontsize=8, loc="lower right")
