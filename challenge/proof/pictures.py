"""Pictures of the sealed proof: power curves, and the instrument."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from challenge.judging.score import clopper_pearson

_INSTRUMENT_AXES = (
    ("column of the chip", "row of the chip"), ("column of the chip", "row of the chip"),
    ("point of the profile", "profile"), ("point of the profile", "profile"),
)  # fmt: skip


def draw_power(scored: dict[str, Any], file: Path) -> None:
    """Draw detected and rightly named shares against strength, with exact intervals."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(10, 4.2), sharey=True, layout="constrained")
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
                axis.annotate(f"{hits} of {len(group)}", (at, share), (6 if hidden else -6, 0),
                              textcoords="offset points", fontsize=8, va="center",
                              ha="left" if hidden else "right")  # fmt: skip
        axis.set_xticks(range(3), ["weak", "medium", "strong"])
        axis.set_xlim(-0.5, 2.5)
        axis.set_ylim(-0.05, 1.05)
        axis.set_xlabel("strength of the hidden fault")
        axis.set_title(title)
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("share of one-effect cases, 95 % interval")
    axes[0].plot([], [], "o", color="tab:blue", label="seen by the paper's checks")
    axes[0].plot([], [], "o", color="tab:orange", label="concealed from them")
    figure.legend(fontsize=8, loc="outside lower center", ncols=2, frameon=False)
    figure.savefig(file, dpi=90)
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
    top = max(first - 4, 0)
    extent = (-0.5, zoom.shape[1] - 0.5, top + zoom.shape[0] - 0.5, top - 0.5)
    axes[1].imshow(zoom, aspect="auto", cmap="gray", extent=extent)
    axes[1].set_title("its first columns: speckle in the line", fontsize=9)
    for axis, image, title in (
        (axes[2], depth_mm, "delivered depth, mm"),
        (axes[3], brightness, "delivered brightness"),
    ):
        figure.colorbar(axis.imshow(image, aspect="auto"), ax=axis).ax.tick_params(labelsize=7)
        axis.set_title(title, fontsize=9)
    for axis, (across, down) in zip(axes, _INSTRUMENT_AXES, strict=True):
        axis.tick_params(labelsize=7)
        axis.set_xlabel(across, fontsize=8)
        axis.set_ylabel(down, fontsize=8)
    figure.tight_layout()
    figure.savefig(file, dpi=80)
    plt.close(figure)
