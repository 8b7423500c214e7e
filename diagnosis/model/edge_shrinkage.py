"""Shrinkage at depth edges towards the nominal model: how much of a change readings support."""

from dataclasses import replace

import numpy as np

from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.predict.expectation import EdgeShares, bending_effects, edge_class
from diagnosis.settings import SETTINGS


def shrunk_at_edges(ws: Workspace, model: Model) -> Model:
    """Return the model with the shares of its changes at edges that fitted readings support."""
    return replace(model, shares=edge_shares(ws, model))


def edge_shares(ws: Workspace, model: Model) -> EdgeShares:
    """Regress readings at edges on what the model changes there, class by class."""
    model = replace(model, effects=tuple(bending_effects(model.effects)), shares=None)
    clip, classes = SETTINGS.model.shrinkage_clip, len(SETTINGS.predict.edge_classes)
    products, squares, count = np.zeros((3, classes))
    if not model.is_nominal:
        moved = ws.placements(model)
        both = zip(ws.patches, ws.predict(Model()), ws.predict(model), ws.masks(), strict=True)
        for patch, plain, full, mask in both:
            sd = ws.noise.sd_mm
            change = (full.mean_mm - plain.mean_mm) / sd
            left = (patch.depth_mm - plain.mean_mm - patch.columns @ moved[patch.recording]) / sd
            pick = mask & patch.edge & np.isfinite(change) & np.isfinite(left)
            c, r = (np.clip(v[pick], -clip, clip) for v in (change, left))
            which = edge_class(np.abs(c))
            products += np.bincount(which, c * r, classes)
            squares += np.bincount(which, c * c, classes)
            count += np.bincount(which, minlength=classes)
    before = SETTINGS.model.shrinkage_readings * squares / np.maximum(count, 1)
    with np.errstate(invalid="ignore", divide="ignore"):
        shares = (products + before) / (squares + before)
    return EdgeShares(shares=np.clip(np.nan_to_num(shares, nan=1.0), 0.0, 1.0))
