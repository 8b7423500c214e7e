"""Residual structure: what no named effect explains, with channel, covariate, size, period, place.

A departure of the mean is drawn on the fitted recordings from the residuals, averaged over
neighbours, and marked where it is large against the noise.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter

from diagnosis.components.row_periods import image_row
from diagnosis.evidence.reported_causes import Unexplained
from diagnosis.fields import Field
from diagnosis.localise.regions import NEIGHBOURS, Region, departure_mask, regions_of
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.settings import SETTINGS
from sensors.view.covariates import COVARIATES
from sensors.view.view import View


@dataclass(frozen=True, kw_only=True, slots=True)
class Residual:
    """Structure in the recordings that no named effect explains.

    Attributes
    ----------
    channel : mean, scale, missing or outliers
    covariate, frame : what it follows, and what that moves with
    size, unit : typical departure, µm (mean); change of the logarithm of the noise (scale), or of
        twice the root of the share of readings (missing, outliers), unit 1
    probability : that there is something that no catalogued effect explains; of what is usual, that
        it is a fault all the same
    period, period_unit : of a periodic one
    regions : where a departure of the mean is large against the noise
    """

    channel: str
    covariate: str
    frame: str
    size: float
    unit: str
    probability: float = 1.0
    detail: str = ""
    period: float | None = None
    period_unit: str = ""
    regions: tuple[Region, ...] = ()

    def as_json(self) -> dict[str, object]:
        """Return the entry of diagnosis.json; what doesn't apply is left out."""
        out: dict[str, object] = {
            "channel": self.channel,
            "covariate": self.covariate,
            "frame": self.frame,
            "size": self.size,
            "unit": self.unit,
            "probability": self.probability,
        }
        if self.period is not None:
            out["period"] = {"value": self.period, "unit": self.period_unit}
        if self.regions:
            out["regions"] = [r.as_json() for r in self.regions]
        if self.detail:
            out["detail"] = self.detail
        return out


def residual_structure(
    unexplained: Sequence[Unexplained], ws: Workspace, model: Model
) -> tuple[Residual, ...]:
    """Describe unknown components that are left beside a model, most probable first.

    Parameters
    ----------
    ws : the patches that were fitted
    """
    in_mean = any(s.channel == "mean" for s in unexplained)
    regions = _regions(ws, model) if in_mean else ()
    return tuple(
        replace(one, regions=regions if one.channel == "mean" else ())
        for one in described(unexplained, ws)
    )


def described(components: Sequence[Unexplained], ws: Workspace) -> tuple[Residual, ...]:
    """Describe components by what they follow and how large they are, most probable first."""
    out = []
    for one in sorted(components, key=lambda s: -s.nats):
        words, frame = _follows(one)
        period, unit = _period(one, ws)
        mean = one.channel == "mean"
        out.append(Residual(
            channel=one.channel, covariate=words, frame=frame,
            size=1e3 * ws.noise.sd_mm * one.size if mean else one.size, unit="µm" if mean else "1",
            probability=one.probability, detail=f"{one.component}, {one.nats:.0f} nats",
            period=period, period_unit=unit,
        ))  # fmt: skip
    return tuple(out)


def _follows(one: Unexplained) -> tuple[str, str]:
    """Words and frame of what a component follows."""
    found = [COVARIATES[n] for n in one.follows]
    return " and ".join(c.words for c in found), found[0].frame


def _period(one: Unexplained, ws: Workspace) -> tuple[float | None, str]:
    """Period of what repeats over the range, in µm at the middle of the readings."""
    if one.relaxed is None or not one.relaxed.periodic or one.relaxed.each or one.repeats <= 0:
        return None, ""
    view = ws.patches[0].view
    slopes = []
    for patch in ws.patches:
        depth = np.sort(patch.view.depth_mm[patch.observed & np.isfinite(patch.view.depth_mm)])
        middle = depth[len(depth) // 4], depth[3 * len(depth) // 4]
        row = np.interp(middle, *_rows(view))
        slopes.append((middle[1] - middle[0]) / max(abs(row[1] - row[0]), 1e-12))
    return 1e3 * float(np.median(slopes)) / one.repeats, "µm"


def _rows(view: View) -> tuple[Field, Field]:
    """Depths over the working range, and the place of their image on the camera."""
    sheet = view.datasheet
    depth = np.linspace(sheet.depth_min_mm, sheet.depth_max_mm, 200)
    return depth, image_row(depth, sheet)


def _regions(ws: Workspace, model: Model) -> tuple[Region, ...]:
    regions: list[Region] = []
    laws = ws.predict(model)
    for patch, law, state in zip(ws.patches, laws, ws.states(laws), strict=True):
        known = state.used & ~patch.edge
        share = np.maximum(uniform_filter(known.astype(float), NEIGHBOURS), 1e-9)
        smooth = uniform_filter(np.where(known, state.residual_mm, 0.0), NEIGHBOURS) / share
        smooth[~known] = 0.0
        if not np.any(np.abs(smooth) > SETTINGS.sharp * law.sd_mm):
            continue
        mask = departure_mask(smooth, np.zeros(patch.shape), law.sd_mm)
        found = regions_of(patch.name, mask, 1e3 * smooth, ())
        regions.extend(region.below(patch.rows.start) for region in found)
    return tuple(regions)
