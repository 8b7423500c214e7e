"""Residual structure: what no named effect explains, with channel, covariate, size, period, place.

A finding is a statistic; a `Residual` is what a reader or a program needs of it. A departure of
the mean that follows a covariate is drawn on the fitted recordings from the coefficients of its
fields, and marked where it is large against the noise.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from diagnosis.families import Family, free_families
from diagnosis.finding import Finding, family_of
from diagnosis.locate import Region, departure_mask, regions_of
from diagnosis.prediction import Prediction
from diagnosis.workspace import Model, Workspace

MOST = 6
"""Findings that are listed, strongest first."""
CHANNELS = {
    "mean": "mean",
    "variance": "scale",
    "correlation": "scale",
    "missing": "missing",
    "tails": "outliers",
}
"""Channel of the predictive distribution of each channel of the statistics."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Residual:
    """Structure in the recordings that no named effect explains.

    Attributes
    ----------
    channel : mean, scale, missing or outliers
    covariate, frame : what it follows, and what that moves with
    size, unit : typical departure, µm (mean); relative change of the noise (scale) or share of
        the readings (missing, outliers), unit 1
    period, period_unit : of a periodic one
    regions : where a departure of the mean is large against the noise
    """

    channel: str
    covariate: str
    frame: str
    size: float
    unit: str
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
        }
        if self.period is not None:
            out["period"] = {"value": self.period, "unit": self.period_unit}
        if self.regions:
            out["regions"] = [r.as_json() for r in self.regions]
        if self.detail:
            out["detail"] = self.detail
        return out


def residual_structure(
    findings: Sequence[Finding], ws: Workspace, model: Model
) -> tuple[Residual, ...]:
    """Describe the strongest findings that are left beside a model.

    Parameters
    ----------
    ws : the patches that were fitted
    model : with which the findings were made
    """
    findings = sorted(findings, key=lambda f: -f.z)[:MOST]
    names = {f.name for f in findings if f.family is not None}
    free = {f.name: f for f in free_families(ws.patches) if f.name in names} if names else {}
    base = ws.predict(model) if names else []
    out = []
    for found in findings:
        in_mean = found.channel == "mean"
        period, unit = (None, "") if found.period is None else found.period
        out.append(
            Residual(
                channel=CHANNELS[found.channel],
                covariate=found.words,
                frame=found.frame,
                size=1e3 * ws.noise.sd_mm * found.size if in_mean else found.size,
                unit="µm" if in_mean else "1",
                detail=found.detail,
                period=period,
                period_unit=unit,
                regions=_regions(found, free, base, ws, model),
            )
        )
    return tuple(out)


def _regions(
    found: Finding,
    free: dict[str, Family],
    base: Sequence[Prediction],
    ws: Workspace,
    model: Model,
) -> tuple[Region, ...]:
    family = family_of(found, free, ws.patches, base, ws.noise, model.effects)
    if family is None:
        return ()
    regions: list[Region] = []
    for patch, fields, plain in zip(ws.patches, family.fields, base, strict=True):
        if fields is None or len(fields) != found.coefficients.size:
            continue
        departure = np.tensordot(found.coefficients, fields, axes=1)
        departure[~(patch.observed & plain.seen)] = 0.0
        mask = departure_mask(departure, np.zeros(patch.shape), plain.sd_mm)
        for region in regions_of(patch.name, mask, 1e3 * departure, ()):
            regions.append(region.below(patch.rows.start))
    return tuple(regions)
