"""Pictures of the payoff: average precision of the three, and what they see in one recording."""

from pathlib import Path
from typing import Any

import numpy as np

from challenge.payoff.gap import KINDS, TRAINED_ON, Outcome
from challenge.payoff.precision import GROUPS
from challenge.payoff.segmenter import smoothed

COLOURS = {
    "plain": "tab:gray",
    "noise": "tab:brown",
    "diagnosed": "gold",
    "both": "tab:orange",
    "instrument": "tab:blue",
}


def draw_precision(
    outcomes: dict[str, dict[str, Outcome]], words: dict[str, str], file: Path
) -> None:
    """Draw the average precision of points, a panel for each world and segmenter; dots are seeds.

    Parameters
    ----------
    outcomes
        Segmenter -> world -> outcome.
    words
        Name of each set in the legend.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import patches
    from matplotlib import pyplot as plt

    names = [name for name in outcomes[KINDS[0]] if name != "all"]
    figure, grid = plt.subplots(
        len(names), len(KINDS), figsize=(7.0 * len(KINDS), 2.4 * len(names) + 0.8), sharex=True,
        sharey=True, squeeze=False,
    )  # fmt: skip
    labels = [f"{kind}, {size}" for kind, size in GROUPS] + ["mean"]
    wide = 0.8 / len(TRAINED_ON)
    for axes, name in zip(grid, names, strict=True):
        for axis, kind in zip(axes, KINDS, strict=True):
            for k, trained in enumerate(TRAINED_ON):
                at = np.arange(len(labels)) + wide * (k - (len(TRAINED_ON) - 1) / 2)
                each = outcomes[kind][name].groups[k]
                every = np.concatenate([each, np.nanmean(each, 1, keepdims=True)], 1)
                axis.bar(at, every.mean(0), 0.95 * wide, color=COLOURS[trained], alpha=0.5)
                for seed in every:
                    axis.plot(at, seed, ".", color=COLOURS[trained], markersize=2.5)
            axis.axvline(len(labels) - 1.5, color="k", linewidth=0.5)
            axis.set_title(f"{name}, {kind}", fontsize=9)
            axis.set_ylim(0, 1)
            axis.grid(axis="y", alpha=0.3)
        axes[0].set_ylabel("average precision\nof points", fontsize=8)
    for axis in grid[-1]:
        axis.set_xticks(range(len(labels)), labels, rotation=90, fontsize=8)
    handles = [
        patches.Rectangle((0, 0), 1, 1, color=COLOURS[name], alpha=0.7) for name in TRAINED_ON
    ]
    figure.legend(
        handles, [words[name] for name in TRAINED_ON], title="trained on", ncols=len(TRAINED_ON),
        loc="upper center", fontsize=9,
    )  # fmt: skip
    figure.tight_layout(rect=(0, 0, 1, 1 - 0.7 / figure.get_size_inches()[1]))
    figure.savefig(file, dpi=80)
    plt.close(figure)


def draw_examples(kept: dict[str, Path], words: dict[str, str], file: Path) -> None:
    """Draw the first sealed recording of each world, the truth, and the suspicions of some sets.

    Parameters
    ----------
    kept
        World -> its tallies, with the recording.
    words
        Name of each set in the titles.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    shown = [(kind, name) for kind in KINDS for name in ("plain", "both", "instrument")]
    titles = ["sealed recording,\nform removed, µm", "true flaws"]
    titles += [f"{kind}, trained on:\n{words[name]}" for kind, name in shown]
    figure, grid = plt.subplots(
        len(kept), len(titles), figsize=(18, 2.0 * len(kept) + 0.5), squeeze=False
    )
    for axes, (name, world) in zip(grid, kept.items(), strict=True):
        with np.load(world) as held:
            depth = np.asarray(held["shown/depth"], np.float64)
            instance = held["shown/instance"]
            panels: list[Any] = [held[f"shown/{kind}/{trained}"] for kind, trained in shown]
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
