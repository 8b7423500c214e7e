"""The picture of a story: scan, what was hidden, what was found, residuals before and after."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from challenge.cases.truth import KS, ROUGHNESS
from challenge.proof.move_panel import draw_move, title_of
from challenge.proof.panel import Panel, name_axes, robust_sd
from challenge.proof.statistic_panel import statistic_panel
from challenge.proof.story import Field, Scanned, Story

SIGNED = "RdBu_r"

def draw_story(story: Story, file: Path) -> None:
    """Draw the panels of a story, two rows of them, into a PNG file."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    panels = panels_of(story)
    columns = (len(panels) + 1) // 2
    figure, axes = plt.subplots(
        2, columns, figsize=(4.2 * columns, 7.4), squeeze=False, layout="constrained"
    )
    for axis in axes.flat[len(panels) :]:
        axis.set_axis_off()
    for axis, panel in zip(axes.flat, panels, strict=False):
        axis.tick_params(labelsize=7)
        panel.draw(axis)
        axis.set_title(panel.title, fontsize=9)
    figure.savefig(file, dpi=85)
    plt.close(figure)


def panels_of(story: Story) -> list[Panel]:
    """List the panels of a story; none of them is empty.

    What was hidden and what was found have one scale, before and after another. A sensor that
    stands elsewhere than its poses say is compared with the nominal model at the poses: a
    placement would take the move up.
    """
    held = story.held
    posed = story.move is not None
    simulated = held.posed_mm if posed else held.simulated_mm
    before = 1e3 * (held.depth_mm - simulated)
    after = 1e3 * (held.depth_mm - held.explained_mm)
    most = _reach(before, after) or 1.0
    lost = np.isfinite(simulated) & ~np.isfinite(held.depth_mm)
    at = " where the poses say" if posed else ""
    compared = posed or story.explains
    residual = _signed(
        f"{'before: ' if compared else ''}scan minus nominal model{at}, µm", before, lost,
        None if posed else held.located, most,
    )  # fmt: skip
    out = [Panel(title="the scan: depth, mm", draw=lambda axis: _depth(axis, held))]
    changes = [1e3 * (held.explained_mm - held.simulated_mm)]
    if story.without_mm is not None:
        changes.append(1e3 * (held.depth_mm - story.without_mm))
    changed = _reach(*changes) or most
    found = _found(story, changed)
    if story.without_mm is None:
        out += [residual, *found]
    else:
        gone = np.isfinite(story.without_mm) & ~np.isfinite(held.depth_mm)
        title = "hidden: scan minus the scan without the fault, µm"
        out += [_signed(title, changes[-1], gone, story.region, changed), *found, residual]
    if compared:
        title = "after: scan minus model with what was found, µm"
        out.append(_signed(title, after, held.lost, None, most))
    checks = Panel(title="the paper's checks: scan minus nominal model",
                   draw=lambda axis: _checks(axis, story))  # fmt: skip
    return [*out, checks]


def _reach(*fields_um: Field) -> float:
    """Return the scale that maps share: the largest 98 % quantile of their sizes."""
    sizes = [np.nanpercentile(np.abs(f), 98) for f in fields_um if np.isfinite(f).any()]
    return float(max(sizes, default=0.0))


def _depth(axis: Any, held: Scanned) -> None:
    drawn = axis.imshow(held.depth_mm, aspect="auto", interpolation="nearest", cmap="viridis")
    axis.figure.colorbar(drawn, ax=axis, shrink=0.85).ax.tick_params(labelsize=7)
    name_axes(axis)


def _signed(
    title: str, image_um: Field, lost: NDArray[np.bool_], region: NDArray[np.bool_] | None,
    most: float,
) -> Panel:  # fmt: skip
    """Return a map in µm with lost readings in black and the outline of a region."""

    def draw(axis: Any) -> None:
        drawn = axis.imshow(
            image_um, aspect="auto", interpolation="nearest", vmin=-most, vmax=most, cmap=SIGNED
        )
        if lost.any():
            black = np.zeros((*lost.shape, 4))
            black[lost] = 0.0, 0.0, 0.0, 1.0
            axis.imshow(black, aspect="auto", interpolation="nearest")
        if region is not None:
            _outline(axis, region)
        axis.figure.colorbar(drawn, ax=axis, shrink=0.85).ax.tick_params(labelsize=7)
        name_axes(axis)

    return Panel(title=title, draw=draw)


def _outline(axis: Any, region: NDArray[np.bool_]) -> None:
    """Draw a region's outline; specks and holes of a few readings are left out."""
    smooth = median_filter(region.astype(np.uint8), size=5)
    if smooth.any() and not smooth.all():
        axis.contour(smooth, [0.5], colors="k", linewidths=0.7)


def _found(story: Story, most: float) -> list[Panel]:
    """Return the move, the change of the mean, or the statistic that the answer is about.

    None where the answer is that nothing departs.
    """
    held, move = story.held, story.move
    if move is not None:
        return [Panel(title=title_of(move), draw=lambda axis: draw_move(axis, move))]
    if story.explains:
        change = 1e3 * (held.explained_mm - held.simulated_mm)
        nothing = np.zeros(change.shape, bool)
        return [_signed("found: what the diagnosis explains, µm", change, nothing, held.located,
                        most)]  # fmt: skip
    return [] if story.answer["verdict"] == "match" else [statistic_panel(story)]


def _checks(axis: Any, story: Story) -> None:
    """Draw the standardised residual of the nominal model, placed, beside the normal law."""
    rest = story.held.depth_mm - story.held.simulated_mm
    rest = rest[np.isfinite(rest)]
    scaled = (rest - np.median(rest)) / robust_sd(rest)
    axis.hist(scaled, bins=80, range=(-5, 5), density=True, color="0.7", label="recording")
    x = np.linspace(-5, 5, 201)
    axis.plot(x, np.exp(-x * x / 2) / np.sqrt(2 * np.pi), "k-", lw=1, label="normal law")
    axis.set_xlabel("residual, standard deviations", fontsize=8)
    axis.set_yticks([])
    axis.set_ylim(0, 0.62)
    axis.legend(fontsize=7, frameon=False, loc="upper right")
    if "ks" in story.facts:
        ks, roughness = story.facts["ks"], 100 * story.facts["roughness"]
        words = (
            f"distance (KS) {ks:.3f}, limit {KS}\n"
            f"roughness off by {roughness:.0f} %, limit {100 * ROUGHNESS:.0f} %"
        )
        axis.text(0.03, 0.97, words, transform=axis.transAxes, va="top", fontsize=7)
