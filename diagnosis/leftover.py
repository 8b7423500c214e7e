"""What is left over must hold on held-out readings, too, as a named effect must.

A smooth departure that follows the sensor or the part is there in every recording. Its fields are
solved on the readings that were fitted, beyond the placement, and asked of the others: u their
whitened residual and p what is predicted for it, the gain is the sum of p u - p²/2.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from diagnosis.families import SCAN, Family, free_families
from diagnosis.finding import Finding, family_of
from diagnosis.noise import Field
from diagnosis.patch import Patch
from diagnosis.prediction import Prediction
from diagnosis.screen import Readings
from diagnosis.workspace import Model, Workspace, block_sums, bootstrap_interval

CERTAIN, BENT = 10.0, 0.4
"""Strength, and size in units of the noise, of a departure that needs no second witness."""
LARGEST_SD = 5.0
"""Departure, in units of the noise, to which free-form coefficients are shrunk."""


def held_findings(
    findings: Sequence[Finding],
    held: Sequence[Patch],
    ws: Workspace,
    model: Model,
    *,
    least_gain: float,
    rng: np.random.Generator,
) -> list[Finding]:
    """Return the findings without those in the mean that held-out readings deny.

    What belongs to one recording, its rows or its time can't be asked and stays; but not a smooth
    map of one scan alone, which the long waves of noise draw, too. What the fitted recordings show
    beyond all doubt always stays: it may be each recording's own.

    Parameters
    ----------
    held : patches with readings that nothing was fitted to
    ws : of the patches that were fitted
    least_gain : nats per held-out reading that a finding must gain
    """
    asked = [
        f
        for f in findings
        if f.channel == "mean" and f.family is not None and not (f.z > CERTAIN and f.size > BENT)
    ]
    if not asked:
        return list(findings)
    judging = [replace(p, fit=p.scored) for p in held]
    both = [*ws.patches, *judging]
    base = replace(ws, patches=tuple(both)).predict(model)
    count = len(ws.patches)
    fitted = _readings(ws.patches, base[:count], ws, rng)
    readings = _readings(judging, base[count:], ws, rng)
    sides = {True: (fitted, readings)}
    sides[False] = (fitted.away_from_edges(), readings.away_from_edges())
    names = {f.name for f in asked}
    free = {f.name: f for f in free_families(both) if f.name in names}
    least = least_gain * sum(int(k.sum()) for k in readings.picks)
    denied, alone = set(), set()
    for finding in asked:
        family = family_of(finding, free, both, base, ws.noise, model.effects)
        if family is not None and any(f is None for f in family.fields):
            family = None  # one scan's own map
        blocks = None if family is None else _gains(family, *sides[family.at_edges], ws)
        if blocks is None:
            if finding.name.startswith(f"free:{SCAN}"):
                alone.add(id(finding))
            continue
        low, _ = bootstrap_interval(blocks, rng)
        if low <= 0 or float(blocks.sum()) < least:
            denied.add(id(finding))
    left = [f for f in findings if id(f) not in denied]
    return left if any(id(f) not in alone for f in left) else []


def _readings(
    patches: Sequence[Patch],
    predictions: Sequence[Prediction],
    ws: Workspace,
    rng: np.random.Generator,
) -> Readings:
    states = replace(ws, patches=tuple(patches)).states(predictions)
    return Readings.build(patches, states, ws.noise, rng, 0)


def _gains(family: Family, fitted: Readings, held: Readings, ws: Workspace) -> Field | None:
    """Nats that each block of the readings held out gains by what the others say."""
    count = len(fitted.patches)
    solved = fitted.projected(replace(family, fields=family.fields[:count]))
    asked = held.projected(replace(family, fields=family.fields[count:]))
    if solved is None or asked is None:
        return None
    fields = solved[0]
    gram = np.asarray(sum(b.T @ b for b in fields.values()), dtype=np.float64)
    right = np.asarray(sum(b.T @ fitted.of(r)[0] for r, b in fields.items()), dtype=np.float64)
    weak = (LARGEST_SD * ws.noise.sd_mm) ** -2 if family.effect is None else 1e-9 * np.trace(gram)
    beta = np.linalg.solve(gram + weak * np.eye(right.size), right)
    sums = []
    for recording, block in asked[0].items():
        predicted = block @ beta
        gain = predicted * held.of(recording)[0] - 0.5 * predicted**2
        for k in held.own[recording]:
            own, gain = np.split(gain, [int(held.picks[k].sum())])
            grid = np.zeros(held.patches[k].shape)
            grid[held.picks[k]] = own
            sums.append(block_sums(grid, ws.block))
    return np.concatenate(sums)
