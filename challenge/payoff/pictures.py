"""Pictures of the payoff: average precision of the three, and what they see in one recording."""

from pathlib import Path
from typing import Any

import numpy as np

from challenge.payoff.gap import TRAINED_ON, Outcome
from challenge.payoff.precision import GROUPS
from challenge.payoff.segmenter import smoothed

COLOURS = {"plain": "tab:gray", "diagnosed": "tab:orange", "instrument": "tab:blue"}


def draw_precision(outcomes: dict[str, Outcome], file: Path) -> None:
    """Draw the average precision of points, a panel for each world: dots are training seeds."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    names = [name for name in outcomes if name != "all"]
    columns = min(3, len(names))
    rows = -(-len(names) // columns)
    figure, grid = plt.subplots(
        rows, columns, figsize=(4.4 * columns, 3.1 * rows), sharey=True, squeeze=False
    )
    labels = [f"{kind}, {size}" for kind, size in GROUPS] + ["mean"]
    for axis, name in zip(grid.flat, names, strict=False):
        for k, trained in enumerate(TRAINED_ON):
            at = np.arange(len(labels)) + 0.25 * (k - 1)
            each = outcomes[name].groups[k]
            every = np.concatenate([each, np.nanmean(each, 1, keepdims=True)], 1)
            axis.bar(at, every.mean(0), 0.23, color=COLOURS[trained], alpha=0.45)
            for seed in every:
                axis.plot(at, seed, ".", color=COLOURS[trained], markersize=3)
            axis.plot([], [], "s", color=COLOURS[trained], label=trained)
        axis.axvline(len(labels) - 1.5, color="k", linewidth=0.5)
        axis.set_xticks(range(len(labels)), labels, rotation=90, fontsize=7)
        axis.set_title(name, fontsize=9)
        axis.set_ylim(0, 1)
        axis.grid(axis="y", alpha=0.3)
    for axis in grid.flat[len(names) :]:
        axis.set_visible(False)
    for row in grid:
        row[0].set_ylabel("average precision of points", fontsize=8)
    grid[0, 0].legend(fontsize=7, title="trained on", title_fontsize=7)
    figure.tight_layout()
    figure.savefig(file, dpi=80)
    plt.close(figure)


def draw_examples(kept: dict[str, Path], file: Path) -> None:
    """Draw the first sealed recording of each world, the truth, and the three suspicions.

    Parameters
    ----------
    kept
        World -> its tallies, with the recording.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    titles = ["sealed recording, form removed, µm", "true flaws"]
    titles += [f"suspicion, trained on: {name}" for name in TRAINED_ON]
    figure, grid = plt.subplots(
        len(kept), len(titles), figsize=(15, 2.0 * len(kept) + 0.3), squeeze=False
    )
    for axes, (name, world) in zip(grid, kept.items(), strict=True):
        with np.load(world) as held:
            depth = np.asarray(held["shown/depth"], np.float64)
            instance = held["shown/instance"]
            panels: list[Any] = [held[f"shown/{trained}"] for trained in TRAINED_ON]
        rest = 1e3 * (depth - smoothed(depth, np.isfinite(depth), 8.0)[0])
        axes[0].imshow(rest, aspect="auto", vmin=-80, vmax=80, cmap="RdBu_r")
        axes[1].imshow(instance > 0, aspect="auto", cmap="gray_r")
        for axis, image in zip(axes[2:], panels, strict=True):
            axis.imshow(image, aspect="auto", vmin=0, vmax=1, cmap="magma")
        axes[0].set_ylabel(name, fontsize=9)
        for axis in axes:
            axis.set_xticks([])
            axis.set_yticks([])
    for axis, title in zip(grid[0], titles, strict=True):
        axis.set_title(title, fontsize=9)
    figure.tight_layout()
    figure.savefig(file, dpi=80)
    plt.close(figure)
