"""What a move of the sensor changes, where each recording's placement takes the change up."""

import numpy as np

from diagnosis.diagnosis import Diagnosis
from diagnosis.fields import Field
from diagnosis.report.canvas import figure_of, png
from diagnosis.validate.found_effects import FoundEffect
from sensors.effects.base import MotionEffect

TAKEN_UP = (
    "The placement of each recording takes the change up: residuals of the nominal model at its "
    "placement do not show the effect."
)


def is_taken_up(result: Diagnosis, found: FoundEffect) -> bool:
    """Whether an effect is a move that the placements hold, not the model of the readings."""
    return isinstance(found.effect, MotionEffect) and found.name not in result.model.names()


def change_um(result: Diagnosis, found: FoundEffect) -> tuple[str, Field]:
    """Return the name of a recording, and by how much the move changes its readings, (n, m)."""
    assert isinstance(found.effect, MotionEffect)
    patch = max((*result.held_patches, *result.fit_patches), key=lambda p: p.depth_mm.size)
    moved = found.effect.moved(patch.view).depth_mm - patch.view.depth_mm
    return patch.name, np.where(np.isfinite(patch.depth_mm), 1e3 * moved, np.nan)


def move_picture(result: Diagnosis, found: FoundEffect) -> bytes | None:
    """Draw the change of the readings; None where nothing is read or nothing changes."""
    name, change = change_um(result, found)
    known = np.abs(change[np.isfinite(change)])
    # steps that a move crosses are no scale for the faces
    limit = float(np.quantile(known, 0.9)) if known.size else 0.0
    if limit == 0.0:
        return None
    figure, (axis,) = figure_of(5.2, 3.6)
    shown = axis.imshow(change, aspect="auto", cmap="RdBu_r", vmin=-limit, vmax=limit,
                        interpolation="nearest")  # fmt: skip
    axis.set_title(f"{name}\nchange of the readings by the move", fontsize=9, parse_math=False)
    axis.set_xlabel("point of the profile", fontsize=8)
    axis.set_ylabel("profile", fontsize=8)
    bar = figure.colorbar(shown, ax=axis, shrink=0.85)
    bar.set_label("sensor as found - sensor where the poses say, µm", fontsize=8)
    bar.ax.tick_params(labelsize=8)
    return png(figure)
