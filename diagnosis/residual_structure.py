"""Residual structure: what no named effect explains, with channel, covariate, size, period, place.

A departure of the mean is drawn on the fitted recordings from the residuals, averaged over
neighbours, and marked where it is large against the noise.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter

from diagnosis.cause import Strange
from diagnosis.components.component import UNKNOWN
from diagnosis.locate import NEIGHBOURS, Region, departure_mask, regions_of
from diagnosis.settings import SETTINGS
from diagnosis.workspace import Model, Workspace
from sensors.view.covariates import COVARIATES


@dataclass(frozen=True, kw_only=True, slots=True)
class Residual:
    """Structure in the recordings that no named effect explains.

    Attributes
    ----------
    channel : mean, scale, missing or outliers
    covariate, frame : what it follows, and what that moves with
    size, unit : typical departure, µm (mean); change of the logarithm of the noise (scale) or of
        the share of readings (missing, outliers), unit 1
    probability : that there is something that no catalogued effect explains
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
    strange: Sequence[Strange], ws: Workspace, model: Model
) -> tuple[Residual, ...]:
    """Describe unknown components that are left beside a model, most probable first.

    Parameters
    ----------
    ws : the patches that were fitted
    """
    in_mean = any(s.channel == "mean" for s in strange)
    regions = _regions(ws, model) if in_mean else ()
    out = []
    for one in sorted(strange, key=lambda s: -s.nats):
        words, frame = _follows(one)
        mean = one.channel == "mean"
        out.append(Residual(
            channel=one.channel, covariate=words, frame=frame,
            size=1e3 * ws.noise.sd_mm * one.size if mean else one.size, unit="µm" if mean else "1",
            probability=one.probability, detail=f"{one.component}, {one.nats:.0f} nats",
            regions=regions if mean else (),
        ))  # fmt: skip
    return tuple(out)


def _follows(one: Strange) -> tuple[str, str]:
    """Words and frame of what a component follows."""
    for component in UNKNOWN:
        if component.name == one.component:
            relaxed = component.relaxed
            if relaxed.each == "column":
                return COVARIATES["column"].words, "sensor"
            if relaxed.along:
                names = [COVARIATES[a] for a in relaxed.along]
                return " and ".join(n.words for n in names), names[0].frame
    return COVARIATES["time"].words, "time"


def _regions(ws: Workspace, model: Model) -> tuple[Region, ...]:
    regions: list[Region] = []
    for patch, law, state in zip(
        ws.patches, ws.predict(model), ws.states(ws.predict(model)), strict=True
    ):
        known = state.used & ~patch.edge
        share = np.maximum(uniform_filter(known.astype(float), NEIGHBOURS), 1e-9)
        smooth = uniform_filter(np.where(known, state.residual_mm, 0.0), NEIGHBOURS) / share
        smooth[~known] = 0.0
        if not np.any(np.abs(smooth) > SETTINGS.sharp * law.sd_mm):
            continue
        mask = departure_mask(smooth, np.zeros(patch.shape), law.sd_mm)
        for region in regions_of(patch.name, mask, 1e3 * smooth, ()):
            regions.append(region.below(patch.rows.start))
    return tuple(regions)
