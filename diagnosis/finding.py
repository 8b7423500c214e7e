"""Findings: how strong and how large a departure is, and what strength chance reaches."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from diagnosis.families import Family, fillet_family, mean_signature
from diagnosis.noise import Field, NoiseModel
from diagnosis.patch import Patch
from diagnosis.prediction import Prediction
from sensors.effects.base import Effect
from sensors.effects.form_error import FormError

LEVEL = 1e-3
SUSPECT = 0.6
"""Share of its tolerance from which a departure at edges or of the noise is worth a fit."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Finding:
    """One statistic.

    Attributes
    ----------
    z : float
        Strength as a Gaussian deviate.
    size : float
        Typical departure where the signature lives, in units of the noise.
    gain : float
        Nats by which the family's best fit beats the model without it.
    coefficients : of the family's fields
    period : (value, unit) of a periodic one
    """

    channel: str
    name: str
    words: str
    frame: str
    z: float
    size: float
    tolerance: float
    gain: float
    coefficients: Field
    family: Family | None = None
    detail: str = ""
    period: tuple[float, str] | None = None

    @property
    def matters(self) -> bool:
        """Whether it is large enough to be called a mismatch."""
        return self.size > self.tolerance


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Screening:
    """All findings, strongest first, and the strength that chance reaches once in a thousand."""

    findings: tuple[Finding, ...]
    threshold: float

    def significant(self) -> list[Finding]:
        """Return the findings beyond chance and tolerance."""
        return [f for f in self.findings if f.z > self.threshold and f.matters]

    def suspect(self) -> list[Finding]:
        """Return findings beyond chance that a maker's approximate law may account for, or not.

        Edges and the noise have wide tolerances: what such a law leaves is a fault of its own,
        unless an effect gains far more than mending that would.
        """
        return [
            f
            for f in self.findings
            if f.z > self.threshold
            and f.size > SUSPECT * f.tolerance
            and (f.channel == "variance" or (f.family is not None and f.family.at_edges))
        ]


def family_of(
    finding: Finding,
    free: Mapping[str, Family],
    patches: Sequence[Patch],
    base: Sequence[Prediction],
    noise: NoiseModel,
    accepted: Sequence[Effect],
) -> Family | None:
    """Return a finding's family of fields on patches; None where it has none there.

    Parameters
    ----------
    free : free-form families on these patches, by name
    base, accepted : prediction of each patch, and the effects in it
    """
    if finding.family is None:
        return None
    effect = finding.family.effect
    if effect is None:
        return free.get(finding.name)
    if isinstance(effect, FormError):
        return fillet_family(patches, effect.fillet_mm)
    fields = mean_signature(effect, patches, base, noise, accepted)
    return None if fields is None else replace(finding.family, fields=tuple(fields))


def as_deviate(chi_square: Field, dof: float) -> Field:
    """Gaussian deviate of the same upper tail as a chi-square statistic."""
    log_tail = stats.chi2.logsf(chi_square, dof)
    far = log_tail < -600
    z = stats.norm.isf(np.exp(np.where(far, -600, log_tail)))
    return np.asarray(np.where(far, np.sqrt(np.maximum(-2 * log_tail, 0)), np.clip(z, -8, None)))


def tail_threshold(maxima: Field, statistics: int) -> float:
    """Strength that the null's maximum exceeds once in a thousand; at least Bonferroni's."""
    finite = maxima[np.isfinite(maxima)]
    bonferroni = float(stats.norm.isf(LEVEL / statistics))
    if finite.size < 10:
        return bonferroni
    scale = max(float(np.std(finite)) * np.sqrt(6) / np.pi, 0.15)
    middle = float(np.mean(finite)) - 0.5772 * scale
    return float(max(bonferroni, middle - scale * float(np.log(-np.log1p(-LEVEL)))))
