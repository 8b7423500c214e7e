"""What the passes of a plan see of a part, and what none of them does."""

from pathlib import Path

import numpy as np

from pipeline.planning.cover import Plan
from pipeline.planning.passes import Samples


def draw_plan(plan: Plan, samples: Samples, title: str, out: Path) -> None:
    """Draw the samples from two sides, unseen ones red, the passes over them; and the trade."""
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
    trade = figure.add_subplot(1, 3, 3)
    trade.step(plan.length_mm, 100 * plan.coverage, where="post", marker="o", ms=4)
    trade.axhline(100 * plan.reachable, color="0.6", ls="--", lw=1)
    trade.annotate("any candidate", (plan.length_mm[0], 100 * plan.reachable), fontsize=8, va="top")
    trade.set_xlabel("length of the passes, mm")
    trade.set_ylabel("surface seen, %")
    trade.set_ylim(0, 103)
    figure.suptitle(title, fontsize=11)
    figure.savefig(out, dpi=100, metadata={"Software": None})
