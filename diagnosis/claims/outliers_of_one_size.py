"""Outliers that all lie equally far off: a bit, a ghost at one distance, no stray light.

Outliers by chance have sizes of any value, r ~ N(0, w²). Those of one cause have one,
r ~ (1 - ε) N(v, (kσ)²) + ε N(0, w²), σ the noise, ε and k by the settings. Whichever makes the
sizes more probable stands.
"""

import numpy as np
from scipy.special import logsumexp
from scipy.stats import norm

from diagnosis.fields import Field
from diagnosis.model.model import Model
from diagnosis.model.workspace import Workspace
from diagnosis.settings import SETTINGS


def one_size_mm(ws: Workspace, model: Model) -> float | None:
    """Return the one size v of the outliers off edges, mm; None where they have many."""
    sizes = []
    for patch, law in zip(ws.patches, ws.predict(model), strict=True):
        residual = patch.depth_mm - law.mean_mm
        pick = patch.fit & patch.observed & patch.counted & law.seen & ~patch.edge
        pick &= np.abs(np.nan_to_num(residual)) > SETTINGS.data.outlier_sd * law.sd_mm
        sizes.append(residual[pick])
    return _one_size(np.concatenate(sizes), SETTINGS.claims.one_size_sd * ws.noise.sd_mm)


def _one_size(sizes: Field, width: float) -> float | None:
    """Weigh one size of a width against any."""
    if sizes.size == 0:
        return None
    r = np.sort(sizes)
    held = np.searchsorted(r, r + 2 * width, side="right") - np.arange(r.size)
    k = int(held.argmax())
    v = float(np.median(r[k : k + held[k]]))
    any_size = norm.logpdf(r, 0.0, np.sqrt(np.mean(r**2)))
    strays = SETTINGS.claims.strays
    one = logsumexp(
        [np.log1p(-strays) + norm.logpdf(r, v, width), np.log(strays) + any_size], axis=0
    )
    known, unknown = SETTINGS.prior_cause, SETTINGS.prior_unknown
    price = np.log(known / unknown) + np.log(r.size)  # it was picked from as many
    return v if float((one - any_size).sum()) > price else None
