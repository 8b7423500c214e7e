"""Shrinkage towards the nominal model: how much of what laws change the fitted readings support."""

from dataclasses import replace

import numpy as np

from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.predict.expectation import Shares, bending_effects, size_class
from diagnosis.settings import SETTINGS


def shrunk(ws: Workspace, model: Model) -> Model:
    """Return the model with the shares of its changes that fitted readings support."""
    return replace(model, shares=supported_shares(ws, model))


def supported_shares(ws: Workspace, model: Model) -> Shares:
    """Regress readings on what the model changes, off edges and at them, class by class."""
    model = replace(model, effects=tuple(bending_effects(model.effects)), shares=None)
    clip, classes = SETTINGS.model.shrinkage_clip, len(SETTINGS.predict.size_classes)
    products, squares, count = np.zeros((3, 2 * classes))
    if not model.is_nominal:
        moved = ws.placements(model)
        both = zip(ws.patches, ws.predict(Model()), ws.predict(model), ws.masks(), strict=True)
        for patch, plain, full, mask in both:
            sd = ws.noise.sd_mm
            change = (full.mean_mm - plain.mean_mm) / sd
            left = (patch.depth_mm - plain.mean_mm - patch.columns @ moved[patch.recording]) / sd
            pick = mask & np.isfinite(change) & np.isfinite(left)
            c, r = (np.clip(v[pick], -clip, clip) for v in (change, left))
            which = size_class(np.abs(c)) + classes * patch.edge[pick]
            products += np.bincount(which, c * r, 2 * classes)
            squares += np.bincount(which, c * c, 2 * classes)
            count += np.bincount(which, minlength=2 * classes)
    before = SETTINGS.model.shrinkage_readings * squares / np.maximum(count, 1)
    with np.errstate(invalid="ignore", divide="ignore"):
        shares = (products + before) / (squares + before)
    shares = np.clip(np.nan_to_num(shares, nan=1.0), 0.0, 1.0)
    return Shares(off_edges=shares[:classes], at_edges=shares[classes:])
