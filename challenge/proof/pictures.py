"""Pictures of the sealed proof: power curves, and one case as a story."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from challenge.judging.score import clopper_pearson


def draw_power(scored: dict[str, Any], file: Path) -> None:
    """Draw detected and rightly named shares against strength, with exact intervals."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(10, 4), sharey=True)
    tests: tuple[tuple[str, Callable[[dict[str, Any]], bool]], ...] = (
        ("something reported", lambda c: bool(c["score"]["alarm"])),
        ("the right name first", lambda c: bool(c["score"]["top_1"] == 1)),
    )
    for axis, (title, test) in zip(axes, tests, strict=True):
        for hidden, colour in ((False, "tab:blue"), (True, "tab:orange")):
            for strength in range(3):
                group = [
                    c
                    for c in scored["cases"].values()
                    if c["secret"]["kind"] == "one"
                    and c["secret"]["strength"] == strength
                    and bool(c["facts"].get("concealed")) == hidden
                ]
                if not group:
                    continue
                hits = sum(test(c) for c in group)
                low, high = clopper_pearson(hits, len(group))
                share = hits / len(group)
                at = strength + (0.08 if hidden else -0.08)
                spread = [[share - low], [high - share]]
                axis.errorbar([at], [share], yerr=spread, fmt="o", color=colour, capsize=3)
                axis.annotate(f"{hits}/{len(group)}", (at + 0.03, share), fontsize=8)
        axis.set_xticks(range(3), ["weak", "medium", "strong"])
        axis.set_ylim(-0.05, 1.05)
        axis.set_title(title)
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("share of one-effect cases")
    axes[0].plot([], [], "o", color="tab:blue", label="seen by the usual checks")
    axes[0].plot([], [], "o", color="tab:orange", label="concealed from them")
    axes[0].legend(fontsize=8, loc="lower right")
    figure.tight_layout()
    figure.savefig(file, dpi=90)
    plt.close(figure)


def draw_story(out: Path, name: str, last: str, file: Path) -> None:
    """Draw the held-out recording: the scan, what the hidden fault changes, what was found.

    The three panels have one frame; the outlines are the true region and the region found.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    with h5py.File(out / "cases" / name / f"{last}.h5") as recording:
        depth = np.asarray(recording["depth"], float)
    panels: list[tuple[str, Any, Any]] = [("the scan: depth, mm", depth, None)]
    maps = out / "keys" / f"{name}.npz"
    if maps.exists():
        truth = np.load(maps)
        change = 1e3 * (truth["on"] - truth["off"])
        change -= np.nanmedian(change)
        panels.append(("hidden: what the fault changes, µm", change, truth["region"]))
    mismatch = out / "answers" / name / "mismatch.h5"
    if mismatch.exists():
        with h5py.File(mismatch) as found:
            group = found[last]
            simulated = np.asarray(group["simulated"], float)
            explained = np.asarray(group["explained"], float)
            mask = np.asarray(group["mask"], bool)
        if not maps.exists():
            panels.append(("scan minus nominal model, µm", 1e3 * (depth - simulated), None))
        panels.append(("found: what the diagnosis explains, µm",
                       1e3 * (explained - simulated), mask))  # fmt: skip
    figure, axes = plt.subplots(
        1, len(panels), figsize=(4.2 * len(panels), 3.8), squeeze=False, layout="constrained"
    )
    sizes = [np.nanpercentile(np.abs(image), 98) for _, image, _ in panels[1:]
             if np.isfinite(image).any()]  # fmt: skip
    most = max(max(sizes, default=1.0), 1.0)
    for k, (axis, (title, image, region)) in enumerate(zip(axes[0], panels, strict=True)):
        signed = {"vmin": -most, "vmax": most, "cmap": "RdBu_r"} if k else {"cmap": "viridis"}
        drawn = axis.imshow(image, aspect="auto", interpolation="nearest", **signed)
        if region is not None and region.any() and not region.all():
            axis.contour(region, [0.5], colors="k", linewidths=0.7)
        axis.set_title(title, fontsize=10)
        axis.set_xlabel("point of the profile", fontsize=8)
        axis.tick_params(labelsize=7)
        figure.colorbar(drawn, ax=axis, shrink=0.85).ax.tick_params(labelsize=7)
    axes[0][0].set_ylabel("profile", fontsize=8)
    figure.savefig(file, dpi=85)
    plt.close(figure)


def draw_instrument(frame: Any, depth_mm: Any, brightness: Any, file: Path) -> None:
    """Draw what the camera sees at one profile, and the depth and brightness it delivers.

    Parameters
    ----------
    frame : (columns, rows)
        Counts.
    depth_mm, brightness : (profiles, columns)
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(1, 4, figsize=(15, 3.8))
    lit = np.flatnonzero(np.asarray(frame).max(0) > 20)
    first, last = (int(lit.min()), int(lit.max())) if lit.size else (0, 40)
    axes[0].imshow(np.sqrt(np.maximum(np.asarray(frame).T, 0)), aspect="auto", cmap="gray")
    axes[0].set_title("camera frame (square root of counts)", fontsize=9)
    zoom = np.asarray(frame)[:60, max(first - 4, 0) : last + 5].T
    axes[1].imshow(zoom, aspect="auto", cmap="gray")
    axes[1].set_title("its first columns: speckle in the line", fontsize=9)
    axes[2].imshow(depth_mm, aspect="auto")
    axes[2].set_title("delivered depth, one profile a row", fontsize=9)
    axes[3].imshow(brightness, aspect="auto")
    axes[3].set_title("delivered brightness", fontsize=9)
    for axis in axes:
        axis.tick_params(labelsize=7)
    figure.tight_layout()
    figure.savefig(file, dpi=80)
    plt.close(figure)
